"""Rules on predictions: a time until they hold, and a threshold at which they end."""

from dataclasses import dataclass
from typing import Final

from ml.robot.task import ABNORMAL
from ml.serving.predictor import Prediction
from server_gui.core.settings.prediction import RuleSettings

HOLE: Final = 3  # times `every_ns`: longer without a prediction, and it begins anew


@dataclass(slots=True)
class PredictionRule:
    """One rule for one robot; predictions are those of its task, in time's order, `every_ns` apart."""

    settings: RuleSettings
    every_ns: int
    holds: bool = False
    _since_ns: int | None = None  # since when the label was probable enough
    _newest_ns: int = 0

    def take(self, prediction: Prediction) -> bool | None:
        """Return True if the rule begins to hold with this prediction, False if it ends, else None."""
        if prediction.stamp_ns - self._newest_ns > HOLE * self.every_ns:
            self._since_ns = None
        self._newest_ns = prediction.stamp_ns
        probability = self._probability(prediction)
        if self.holds:
            self.holds = probability >= self.settings.ends_below
            self._since_ns = None
            return None if self.holds else False
        if probability < self.settings.at_least:
            self._since_ns = None
            return None
        if self._since_ns is None:
            self._since_ns = prediction.stamp_ns
        self.holds = prediction.stamp_ns - self._since_ns >= self.settings.for_ms * 1_000_000
        return True if self.holds else None

    def _probability(self, prediction: Prediction) -> float:
        """Return the probability of the rule's label; "abnormal" is never a model's class."""
        if prediction.label == ABNORMAL or self.settings.label == ABNORMAL:
            return float(prediction.label == self.settings.label)
        return prediction.probabilities.get(self.settings.label, 0.0)
