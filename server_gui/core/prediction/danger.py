"""Danger of one robot, live: its rows go to the detectors, what these say becomes news and rules."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from gateway.client import Batch
from ml.danger.calibration import Calibration
from ml.danger.levels import URGENT, Level
from ml.danger.monitor import DangerMonitor, DangerVerdict
from ml.danger.observation import CHANNELS
from ml.serving.predictor import Prediction
from server_gui.core.prediction.clock import Clock
from server_gui.core.prediction.news import Endangered, Ruled
from server_gui.core.prediction.rules import PredictionRule
from server_gui.core.prediction.state import DangerReport
from server_gui.core.settings.prediction import DANGER, RuleSettings

EVERY_NS: Final = 40_000_000  # between two verdicts, at most as many as rows
TELLS_NS: Final = 500_000_000  # while its level stays, it is told so seldom
MODEL: Final = "danger"
OBJECTION: Final = "the calibration of danger came with GWRMS, and nobody has promoted it"

News = Endangered | Ruled


class DangerWatch:
    """One robot, for the thread that predicts; a rule on danger says why it stops no robot."""

    def __init__(self, robot: str, calibration: Calibration, rules: Iterable[RuleSettings]) -> None:
        self._robot = robot
        self._calibration = calibration
        self._rules = [PredictionRule(rule, EVERY_NS) for rule in rules if rule.task == DANGER]
        self.restart()

    def restart(self) -> None:
        """Begin anew: the robot has booted, or another one wears it."""
        self._watch = DangerMonitor(self._calibration)
        self.newest: DangerReport | None = None
        self._told: DangerVerdict | None = None

    def take(self, batch: Batch, clock: Clock) -> Iterator[News]:
        """Take rows; what is to be told of them."""
        nothing: list[float | None] = [None] * len(batch.stamps_ns)
        columns = [batch.columns.get(name, nothing) for name in CHANNELS]
        for stamp_ns, values in zip(batch.stamps_ns, zip(*columns, strict=True), strict=True):
            verdict = self._watch.take(stamp_ns, values)
            if verdict is not None:
                yield from self._news(verdict, clock)

    def _news(self, verdict: DangerVerdict, clock: Clock) -> Iterator[News]:
        said = Endangered(
            self._robot,
            verdict,
            prediction(verdict),
            clock.utc_ns(verdict.stamp_ns),
            clock.age_ns(verdict.stamp_ns),
        )
        for rule in self._rules:
            if (began := rule.take(said.prediction)) is not None:
                yield Ruled(self._robot, rule.settings, began, said, OBJECTION)
        before = self._told
        if (
            before is None
            or before.level is not verdict.level
            or not 0 <= verdict.stamp_ns - before.stamp_ns < TELLS_NS
        ):
            self._told, self.newest = verdict, DangerReport(said.text, said.utc_ns / 1e9)
            yield said


def prediction(verdict: DangerVerdict) -> Prediction:
    """Return the verdict as rules take it.

    Each level that is reached has the probability of harm, others none.
    """
    number = 0.0 if verdict.number is None else verdict.number
    reached: Mapping[str, float] = {
        level.word.replace(" ", "_"): number if verdict.level >= level else 0.0 for level in URGENT
    }
    label = verdict.level.word.replace(" ", "_")
    known = verdict.level is not Level.UNKNOWN
    return Prediction(DANGER, MODEL, verdict.stamp_ns, label, number, 0.0, dict(reached) if known else {})
