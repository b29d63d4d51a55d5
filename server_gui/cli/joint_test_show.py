"""`gwrms joint-test show`: what a joint's test has measured, beside the last one of that joint."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from gateway.cli.text import say, say_json, table, warn
from server_gui.core.joint_tests.comparing import AnalysedTest, analysed, differences, last_before, told
from server_gui.core.joint_tests.file import NotReadable
from server_gui.core.joint_tests.measures import Measure

EPILOG: Final = """\
Figures that could not be measured are dashes, with the reason. Proposals are for you to decide on: nothing
writes them. gwrms docs how-to/test-a-joint explains how each figure is found.

exit status
  0 shown, 1 not to be read, 2 usage"""


def main(argv: list[str]) -> int:
    """Run `gwrms joint-test show`."""
    parser = argparse.ArgumentParser(
        prog="gwrms joint-test show",
        description="Show the results of a joint test.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "file", type=Path, metavar="FILE", help="recording of gwrms joint-test step, chirp, …"
    )
    parser.add_argument(
        "--compare",
        type=Path,
        metavar="FILE",
        help="compare with this one (default: the last one beside it)",
    )
    parser.add_argument(
        "--json", action="store_true", help="print everything, with curves, as one JSON object"
    )
    options = parser.parse_args(argv)
    try:
        shown = analysed(options.file)
        before = options.compare or last_before(shown.test)
        last = None if before is None else analysed(before)
    except (NotReadable, OSError) as error:
        warn("joint-test", str(error))
        return 1
    if options.json:
        say_json(told(shown, last))
    else:
        say("\n".join(_page(shown, last)) + "\n")
    return 0


def _page(shown: AnalysedTest, last: AnalysedTest | None) -> Iterator[str]:
    head = shown.test.head
    yield f"{head.robot} {head.joint}: {head.test} test of {head.began}, by {head.who}"
    if shown.test.problem is not None:
        yield f"NOT WHOLE: {shown.test.problem}"
    known = {} if last is None else {one.name: one for one in last.result.measures}
    rows = [(one.name, _number(one), one.unit, _number(known.get(one.name))) for one in shown.result.measures]
    yield table(("MEASURE", "VALUE", "UNIT", "LAST"), rows, right=(1, 3)).rstrip()
    yield from _unknown(shown)
    yield from shown.result.notes
    for one in shown.result.proposals:
        gains = ", ".join(f"{name} {value:.4g}" for name, value in one.gains.items())
        yield f"To try, by hand: {gains}\n  {one.reason} ({one.source})"
    if last is None:
        yield "No earlier test of this joint lies beside it."
        return
    yield f"The last one is of {last.test.head.began}: {last.test.path.name}"
    found = list(differences(shown.test, last.test))
    yield from (f"  not the same: {one}" for one in found)
    if not found:
        yield "  robot, firmware, parameters and test were the same"


def _unknown(shown: AnalysedTest) -> Iterator[str]:
    """Yield each reason once, with the figures that are missing for it."""
    missing: dict[str, list[str]] = {}
    for one in shown.result.measures:
        if one.value is None:
            missing.setdefault(one.why, []).append(one.name)
    for why, names in missing.items():
        which = "all figures" if len(names) == len(shown.result.measures) > 1 else ", ".join(names)
        yield f"{which}: unknown: {why}"
    if missing and shown.test.problem is not None:
        yield f"The test ended early: {shown.test.problem}"


def _number(one: Measure | None) -> str:
    if one is None or one.value is None:
        return "–"
    return f"{one.value:.4g}" + ("" if one.spread is None else f" ± {one.spread:.2g}")
