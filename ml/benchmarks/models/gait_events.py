"""Gait events of a foot: boosted trees say whether a moment is near one, and how far from it."""

from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

from ml.errors import UnusableData

Features = npt.NDArray[np.float32]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int_]

NONE: Final = 1_000_000  # samples to an event where there is none
APART: Final = 30  # samples: a foot has no two events of a kind closer than that


@dataclass(frozen=True, slots=True)
class EventSettings:
    """What was tuned."""

    rounds: int = 60
    leaves: int = 10
    threshold: float = 0.35  # of the probability: the best F1 has it near to half of that F1


class EventModel:
    """Features of `LEFT_EVENTS` or `RIGHT_EVENTS` at moments that may be events of one kind → events."""

    def __init__(self, settings: EventSettings | None = None) -> None:
        self.settings = settings or EventSettings()

    def fit(self, x: Features, offset: Integers) -> Self:
        """Learn from moments of which `offset` (n,) is samples to the event that is meant, or NONE.

        Raises:
            UnusableData: none of them is an event.

        """
        tuned, near = self.settings, offset != NONE
        if not near.any():
            raise UnusableData("too few feet step: some have nobody to learn from")
        common: dict[str, Any] = {
            "max_iter": tuned.rounds,
            "max_leaf_nodes": tuned.leaves,
            "max_features": 0.3,
            "max_bins": 63,
            "l2_regularization": 1.0,
            "early_stopping": False,
            "random_state": 0,
        }
        # Where every moment is an event there is nothing to tell apart.
        self.whether_ = None if near.all() else HistGradientBoostingClassifier(**common).fit(x, near)
        when = HistGradientBoostingRegressor(loss="absolute_error", **common)
        self.when_ = when.fit(x[near], offset[near])
        return self

    def events(self, x: Features, at: Integers) -> Integers:
        """Return the samples of one foot's events, in time's order, of moments at the samples `at`."""
        if not len(at):
            return at
        probability = np.ones(len(at)) if self.whether_ is None else self.whether_.predict_proba(x)[:, 1]
        moment = np.rint(at + self.when_.predict(x)).astype(np.int_)
        found: list[int] = []
        for place in np.argsort(-probability, kind="stable").tolist():
            if probability[place] < self.settings.threshold:
                break
            if all(abs(moment[place] - other) > APART for other in found):
                found.append(int(moment[place]))
        return np.array(sorted(found), dtype=np.int_)
