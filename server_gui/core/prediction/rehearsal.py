"""A rule rehearsed over recordings: how often it would have begun to hold, and how often without cause."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from msgspec import Struct

from ml.serving.predictor import Prediction
from server_gui.core.prediction.rules import PredictionRule
from server_gui.core.settings.prediction import RuleSettings

LEAD_NS: Final = 1_500_000_000  # a rule may begin so long before what it warns of
HOUR_NS: Final = 3_600_000_000_000


@dataclass(frozen=True, slots=True)
class Stretch:
    """Predictions of one recording, in time's order; `length_ns` of it were watched.

    `causes` are the times (ns, of the same clock) in which a rule is right to hold; None where nobody knows.
    """

    predictions: Sequence[Prediction]
    length_ns: int
    causes: Sequence[tuple[int, int]] | None


class Rehearsed(Struct, frozen=True):
    """Result of a rule: `began` times in `hours`; `false` times of these without cause, as far as known.

    `known` says whether anybody knows when there was cause; where nobody does, every time counts as false.
    """

    rule: RuleSettings
    hours: float
    began: int
    false: int
    known: bool

    @property
    def false_per_hour(self) -> float:
        """Rate of actions without cause."""
        return self.false / self.hours if self.hours else 0.0


def rehearse(rule: RuleSettings, every_ns: int, stretches: Iterable[Stretch]) -> Rehearsed:
    """Apply a rule to recordings, to each by itself; predictions of other tasks are left out."""
    began = false = length_ns = 0
    known = False
    for stretch in stretches:
        length_ns += stretch.length_ns
        known |= stretch.causes is not None
        for at_ns in _begins(PredictionRule(rule, every_ns), stretch.predictions):
            began += 1
            false += not _caused(at_ns, stretch.causes or ())
    return Rehearsed(rule, length_ns / HOUR_NS, began, false, known)


def _begins(rule: PredictionRule, predictions: Iterable[Prediction]) -> Iterable[int]:
    own = (one for one in predictions if one.task == rule.settings.task)
    return [one.stamp_ns for one in own if rule.take(one)]


def _caused(at_ns: int, causes: Sequence[tuple[int, int]]) -> bool:
    """Return whether there was cause then, or so soon after it that a rule may warn of it."""
    return any(begin_ns - LEAD_NS <= at_ns <= end_ns for begin_ns, end_ns in causes)
