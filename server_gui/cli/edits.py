"""`gwrms edits`: what each edit of a robot's parameters did to the walk, as evidence before and after it."""

import argparse
import collections
from collections.abc import Iterator
from typing import Any, Final

import msgspec

from gateway.amounts import NONE, counted
from gateway.cli.text import say, say_json, table, warn
from ml.store.private import private_files
from server_gui.cli.cloud_options import parser, spool
from server_gui.core.evidence.comparison import Measured, Word
from server_gui.core.evidence.experiment import Experiment
from server_gui.core.evidence.file import EditEvidence, folder_beside, read_all
from server_gui.core.evidence.wording import interval, number, share, strides
from server_gui.core.experiments.plan import ExperimentKind
from server_gui.core.experiments.wording import chart, record, what, whole

EPILOG: Final = """commands
  gwrms edits            list every edit, A/B trial and sweep, oldest first: when, who, what, its effect
  gwrms edits show ID    show one of them: every metric before and after, with its interval

Evidence is gathered by the desk that records the robot (the window, or gwrms collect) while somebody walks
before and after the edit; gwrms docs how-to/judge-an-edit explains the words.

exit status
  0 shown, 1 not known or not to be read, 2 wrong usage"""
HEADER: Final = ("ID", "WHEN (UTC)", "ROBOT", "WHO", "WHAT", "STATE", "VERDICT", "STRONGEST")
COLUMNS: Final = ("METRIC", "WORD", "BEFORE", "AFTER", "DIFFERENCE", "95 % INTERVAL", "SIZE", "UNIT")
NOTHING: Final = (
    "no edit is known here: gwrms collect or the window records them, while it follows the robot on this "
    "computer and somebody walks; one is here a minute after it was taken back, or two after it was kept "
    "(until then the window shows it)"
)
EXPLAINED: Final = """
The difference is the edit's: without a slow drift, and at equal speed; its interval holds in 95 of 100 edits.
The size is the difference in standard deviations of single cycles. A verdict needs both: a difference that is
sure although many metrics were looked at, and one that is large enough to matter.
"""
EXPLAINED_AB: Final = """
Before is A, after is B. The difference is that of the pairs, tested by all orders that might have been drawn:
no drift, straight or bent, is taken for it. A verdict needs a difference that is sure, and large enough.
"""


def main(argv: list[str]) -> int:
    """Run `gwrms edits`."""
    private_files()
    return show(argv[1:]) if argv[:1] == ["show"] else ls(argv)


def ls(argv: list[str]) -> int:
    """List them."""
    made = parser("edits", "Show the effect of each parameter edit on the walk.", EPILOG)
    made.add_argument(
        "--robot", action="append", default=[], metavar="NAME", help="only this robot's edits (repeatable)"
    )
    arguments = made.parse_args(argv)
    found = _read(arguments)
    if found is None:
        return 1
    found = [told for told in found if told.edit.robot in (arguments.robot or (told.edit.robot,))]
    found = whole(found)
    if arguments.json:
        say_json([fields(told) for told in found])
    elif found:
        say(table(HEADER, map(_row, found)))
    else:
        warn("edits", NOTHING)
    return 0


def show(argv: list[str]) -> int:
    """Show one."""
    made = parser("edits show", "Show all data on one edit.")
    made.add_argument("id", metavar="ID", help="id from gwrms edits; may be abbreviated")
    arguments = made.parse_args(argv)
    found = _read(arguments)
    if found is None:
        return 1
    chosen = [told for told in found if told.edit.id.startswith(arguments.id)]
    if len(chosen) != 1:
        what = counted(len(chosen), "edit begins so", "edits begin so") if chosen else NOTHING
        warn("edits", f"{arguments.id}: {what}; gwrms edits lists them")
        return 1
    if arguments.json:
        say_json(fields(chosen[0]))
    else:
        say("\n".join(shown(chosen[0])) + "\n")
    return 0


def _read(arguments: argparse.Namespace) -> list[EditEvidence] | None:
    folder = folder_beside(spool(arguments))
    try:
        return read_all(folder)
    except OSError as error:
        warn("edits", f"{folder} cannot be read: {error.strerror or error}")
        return None


def fields(told: EditEvidence) -> dict[str, Any]:
    """Return an edit for machines."""
    found: dict[str, Any] = msgspec.to_builtins(told)
    return found


def _row(told: EditEvidence) -> tuple[str, ...]:
    edit, evidence = told.edit, told.evidence
    strongest = next((one for one in evidence.metrics if one.series == evidence.strongest), None)
    return (
        edit.id,
        edit.utc,
        edit.robot,
        edit.who,
        what(told),
        edit.became,
        str(evidence.word),
        NONE if strongest is None else f"{strongest.title} {share(strongest)}",
    )


def shown(told: EditEvidence) -> Iterator[str]:
    """Yield everything that is known of one, in lines."""
    edit, evidence, tried = told.edit, told.evidence, told.experiment
    yield f"{tried.kind if tried else 'edit'} {edit.id} of {edit.robot}, {edit.utc}, by {edit.who or NONE}"
    yield f"  {what(told)}"
    if tried is None:
        yield f"  {edit.became}; entry {edit.n} of the robot's journal; recording {told.session or NONE}"
        yield from (f"  not as before: {line}" for line in edit.not_back)
    else:
        yield f"  recording {told.session or NONE}"
        yield from (f"  {line}" for line in record(tried))
    yield ""
    before, after = evidence.cycles_before, evidence.cycles_after
    if tried is None:
        yield f"{evidence.word}: {strides(evidence)}"
    elif rows := list(chart(tried)):
        yield table(_columns(tried), rows, right=(0, 1, 4)).rstrip()
    elif tried.kind == ExperimentKind.AB:
        yield f"{evidence.word}: {counted(before, 'gait cycle')} with A, {after} with B"
    yield from (f"  {note}" for note in evidence.notes)
    yield from (
        f"  left out: {counted(count, 'cycle')}, {why}" for why, count in sorted(evidence.left_out.items())
    )
    yield ""
    judged = [one for one in evidence.metrics if one.p is not None]
    if judged:
        yield table(COLUMNS, map(metric_row, sorted(judged, key=_order)), right=(2, 3, 4, 6)).rstrip()
    few = collections.Counter(one.why for one in evidence.metrics if one.word is Word.FEW)
    yield from (f"not enough cycles for {counted(count, 'metric')}: {why}" for why, count in few.items())
    silent = [one for one in evidence.metrics if one.word is Word.NO_DATA]
    if silent:
        titles = ", ".join(one.title for one in silent)
        yield f"\nno data: {titles if judged else counted(len(silent), 'metric')}"
    if judged:
        yield (EXPLAINED if tried is None else EXPLAINED_AB).rstrip()


def _columns(tried: Experiment) -> tuple[str, ...]:
    judged = next(each for each in tried.responses if each.series == tried.judged_by)
    unit = f", {judged.unit}" if judged.unit else ""
    return "VALUE", f"{judged.title}{unit}".upper(), "95 % INTERVAL", "", "CYCLES", ""


def _order(one: Measured) -> float:
    return -abs(one.size or 0.0) if one.word not in (Word.SAME, Word.FEW) else 1.0


def metric_row(one: Measured) -> tuple[str, ...]:
    """Return a row of `COLUMNS`."""
    return (
        one.title,
        str(one.word),
        number(one.before),
        number(one.after),
        share(one),
        interval(one),
        NONE if one.size is None else f"{one.size:+.1f}",
        one.unit,
    )
