"""Scenarios' results for programs: a line of JSON each, and JUnit's XML as CI systems read it."""

import re
import socket
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from hil_sim.scenario.expectation import ScenarioResult, Verdict
from hil_sim.scenario.runner import ScenarioOutcome
from hil_sim.scenario.script import Script

_NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # XML 1.0 §2.2


@dataclass(frozen=True, slots=True)
class Ran:
    """One file, what stands in it, and what came of it; `began_s` is Unix time."""

    file: Path
    script: Script
    outcome: ScenarioOutcome
    began_s: float


def as_json(ran: Ran) -> dict[str, Any]:
    """Return the object of one scenario."""
    outcome = ran.outcome
    return {
        "file": str(ran.file),
        "title": ran.script.title,
        "result": outcome.result,
        "seconds": round(outcome.seconds, 3),
        "left_out_s": round(outcome.skipped_s, 3),
        "problem": outcome.problem or None,
        "expectations": [
            {
                "expected": verdict.expected,
                "result": verdict.result,
                "seen": verdict.seen,
                "decided_s": verdict.decided_s,
                "doubt": verdict.doubt or None,
            }
            for verdict in outcome.verdicts
        ],
    }


def total_as_json(results: Iterable[ScenarioResult]) -> dict[str, int]:
    """Return the object of all: how many there were, and how many of each result."""
    count = Counter(results)
    return {"scenarios": count.total()} | {
        result.replace(" ", "_"): count[result] for result in ScenarioResult
    }


def junit(runs: Sequence[Ran]) -> bytes:
    """Return JUnit's XML: a test suite a file, a test case an expectation."""
    suites = ElementTree.Element("testsuites", name="gwrms sim run")
    for ran in runs:
        _suite(suites, ran)
    cases = [suite.attrib for suite in suites]
    for count in ("tests", "failures", "errors", "skipped"):
        suites.set(count, str(sum(int(one[count]) for one in cases)))
    suites.set("time", f"{sum(ran.outcome.seconds for ran in runs):.3f}")
    ElementTree.indent(suites)
    text: bytes = ElementTree.tostring(suites, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _suite(suites: ElementTree.Element, ran: Ran) -> None:
    outcome = ran.outcome
    count = Counter(verdict.result for verdict in outcome.verdicts)
    suite = ElementTree.SubElement(
        suites,
        "testsuite",
        name=_plain(str(ran.file)),
        tests=str(len(outcome.verdicts) or 1),
        failures=str(count[ScenarioResult.FAILED]),
        errors=str(int(bool(outcome.problem))),
        skipped=str(count[ScenarioResult.INCONCLUSIVE]),
        time=f"{outcome.seconds:.3f}",
        timestamp=datetime.fromtimestamp(ran.began_s, UTC).strftime("%Y-%m-%dT%H:%M:%S"),
        hostname=socket.gethostname(),
    )
    share_s = outcome.seconds / max(1, len(outcome.verdicts))  # one run decides all of them
    for verdict in outcome.verdicts:
        _case(suite, ran, verdict, share_s)
    if not outcome.verdicts:
        case = _new_case(suite, ran, ran.script.title, share_s)
        if outcome.problem:
            _say(case, "error", "it could not be run", outcome.problem)


def _case(suite: ElementTree.Element, ran: Ran, verdict: Verdict, share_s: float) -> None:
    case = _new_case(suite, ran, verdict.expected, share_s)
    if verdict.result is ScenarioResult.FAILED:
        _say(case, "failure", verdict.seen, f"expected: {verdict.expected}\nseen: {verdict.seen}")
    elif verdict.result is ScenarioResult.INCONCLUSIVE:
        ElementTree.SubElement(case, "skipped", message=_plain(f"{verdict.doubt}; seen: {verdict.seen}"))


def _new_case(suite: ElementTree.Element, ran: Ran, name: str, share_s: float) -> ElementTree.Element:
    of_file = ".".join(part for part in ran.file.with_suffix("").parts if part not in ("/", ".", ".."))
    return ElementTree.SubElement(
        suite, "testcase", classname=_plain(of_file), name=_plain(name), time=f"{share_s:.3f}"
    )


def _say(case: ElementTree.Element, kind: str, message: str, text: str) -> None:
    ElementTree.SubElement(case, kind, message=_plain(message), type=kind).text = _plain(text)


def _plain(text: str) -> str:
    """Return text that XML allows; other characters are replaced, not left out."""
    return _NOT_IN_XML.sub("\ufffd", text)
