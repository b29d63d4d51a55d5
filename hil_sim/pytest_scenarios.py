"""Scenario files as pytest's tests: one each, with its report in the place of a traceback."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hil_sim.scenario import report
from hil_sim.scenario.expectation import ScenarioResult
from hil_sim.scenario.runner import GATEWAY_LOG, run
from hil_sim.scenario.script import Script, load
from hil_sim.scenario.table import ScenarioError

_LAST_WORDS = 4000  # of the gateway's log, shown with what failed


class NotAsExpected(Exception):
    """A scenario did not hold, or could not be run; the message is its report."""


class ScenarioFile(pytest.File):
    """One file."""

    def collect(self) -> Iterator["ScenarioItem"]:
        try:
            script = load(self.path)
        except ScenarioError as error:
            raise self.CollectError(str(error)) from error
        yield ScenarioItem.from_parent(self, name=script.title, script=script)


class ScenarioItem(pytest.Item):
    """A scenario file as a test."""

    def __init__(self, *, script: Script, **given: Any) -> None:
        super().__init__(**given)
        self._script = script

    def runtest(self) -> None:
        """Run it in a folder of its own.

        Raises:
            NotAsExpected: it did not hold, or could not be run.

        """
        with tempfile.TemporaryDirectory(prefix="gwrms-") as folder:
            outcome = run(self._script, Path(folder))
            log = _last_words(Path(folder) / GATEWAY_LOG)
        self.add_report_section("call", GATEWAY_LOG, log)
        if outcome.result is ScenarioResult.INCONCLUSIVE and not self.config.getoption("gwrms_strict"):
            pytest.skip(f"inconclusive: {outcome.doubt}")
        if outcome.result is not ScenarioResult.PASSED:
            raise NotAsExpected(report.text(self.path, self._script, outcome) + outcome.problem)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the report in the place of a traceback."""
        if isinstance(excinfo.value, NotAsExpected):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        return self.path, None, self.name


def _last_words(log: Path) -> str:
    try:
        return log.read_text(encoding="utf-8", errors="replace")[-_LAST_WORDS:]
    except OSError:
        return ""
