"""A scenario's result as a table that a person reads."""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from hil_sim.scenario.expectation import ScenarioResult, Verdict
from hil_sim.scenario.runner import ScenarioOutcome
from hil_sim.scenario.script import Script

_MARKS = {
    ScenarioResult.PASSED: "ok    ",
    ScenarioResult.FAILED: "FAILED",
    ScenarioResult.INCONCLUSIVE: "?     ",
}


def text(file: Path, script: Script, outcome: ScenarioOutcome) -> str:
    """Return the whole: `head`, then `result`."""
    return head(file, script) + result(outcome)


def head(file: Path, script: Script) -> str:
    """Return the first line, which can be said before it is run."""
    return f"{file}: {script.title}\n"


def result(outcome: ScenarioOutcome) -> str:
    """Return a line for each expectation, and below it what was seen."""
    lines = []
    for verdict in outcome.verdicts:
        lines.append(f"  {_MARKS[verdict.result]}  {verdict.expected}")
        lines.append(f"          {verdict.seen}")
        if verdict.doubt:
            lines.append(f"          inconclusive: {verdict.doubt}")
    lines.append(_summary(outcome))
    if outcome.skipped_s:
        lines.append(
            f"This computer was too slow: {outcome.skipped_s:.1f} s were left out. Times may be off by that."
        )
    return "\n".join(lines) + "\n"


def total(results: Iterable[ScenarioResult]) -> str:
    """Return the last line: how many scenarios, and what came of them."""
    count = Counter(results)
    said = [f"{count[result]} {result}" for result in ScenarioResult if count[result]]
    return f"{_counted(count.total(), 'scenario')}: {', '.join(said)}\n"


def _summary(outcome: ScenarioOutcome) -> str:
    verdicts = outcome.verdicts
    if outcome.problem:
        return ScenarioResult.NOT_RUN
    wrong = [
        f"{count} {word}"
        for word, count in (
            ("failed", _count(verdicts, ScenarioResult.FAILED)),
            ("inconclusive", _count(verdicts, ScenarioResult.INCONCLUSIVE)),
        )
        if count
    ]
    if wrong:
        return f"of {_counted(len(verdicts), 'expectation')} {', '.join(wrong)}"
    return f"{_counted(len(verdicts), 'expectation')} met"


def _count(verdicts: Sequence[Verdict], result: ScenarioResult) -> int:
    return sum(verdict.result is result for verdict in verdicts)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"
