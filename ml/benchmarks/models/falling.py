"""A beginning fall: boosted trees on every decision, an alarm on the mean of the last few.

The trees learn on folds of people; what each fold says of those it has not seen gives the threshold, and
all of them together decide about a new one.
"""

from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.model_selection import GroupKFold

from ml.errors import UnusableData
from ml.features.falling import moving

Features = npt.NDArray[np.float32]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int_]
Flags = npt.NDArray[np.bool_]

FAR: Final = 1_000_000  # samples to an impact where there is none
TOGETHER: Final = 32_768  # rows judged at a time


@dataclass(frozen=True, slots=True)
class FallSettings:
    """Tuned settings."""

    falling: int = 20  # samples before the impact that are falling
    unclear: int = 50  # samples before the impact that are neither, up to those
    moving_share: float = 0.22  # of the daily decisions in which somebody moves that are learned from
    still_share: float = 0.015  # of the others: they are many and alike
    rounds: int = 120
    leaves: int = 15
    folds: int = 3
    decisions: int = 4  # whose mean is compared with the threshold
    false_alarms: float = 0.06  # of daily recordings, by one set of trees; all together cost less


class FallDetector(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn ships no types
    """Features of `FALLING` → probability that a fall has begun; an alarm from `threshold_` on."""

    def __init__(self, settings: FallSettings | None = None) -> None:
        self.settings = settings or FallSettings()

    def fit(
        self,
        x: Features,
        to_impact: Integers,
        recording: Integers,
        subject: Integers,
        rows: npt.NDArray[np.intp] | None = None,
    ) -> Self:
        """Learn from every decision (row) of whole recordings, in their order; or from `rows` alone.

        `to_impact`: samples until a fall's impact, FAR where there is none. Features are large: those of
        `rows` are never copied as a whole.

        Raises:
            UnusableData: falls, or daily life, are those of too few people.

        """
        tuned = self.settings
        rows = np.arange(len(x)) if rows is None else rows
        to_impact, recording, subject = to_impact[rows], recording[rows], subject[rows]
        falling, learned = self._lessons(to_impact, moving(x)[rows])
        self.trees_, unseen = [], np.zeros(len(rows))
        folds = GroupKFold(min(tuned.folds, len(np.unique(subject))))
        for train, held_out in folds.split(rows, groups=subject):
            lessons = train[learned[train]]
            if len(np.unique(falling[lessons])) < 2:
                raise UnusableData("too few people fall, or too few do not: some have nobody to learn from")
            trees = fall_trees(tuned).fit(x[rows[lessons]], falling[lessons])
            unseen[held_out] = probability_of(trees, x, rows[held_out])
            self.trees_.append(trees)
        daily = ~np.isin(recording, recording[falling])
        self.threshold_ = self._threshold(unseen[daily], recording[daily])
        return self

    def predict_proba(self, x: Features) -> Floats:
        """(rows, 2): of not falling, of falling."""
        every = np.stack([trees.predict_proba(x) for trees in self.trees_])
        mean: Floats = every.mean(axis=0)
        return mean

    def alarms(self, x: Features, recording: Integers, rows: npt.NDArray[np.intp] | None = None) -> Flags:
        """Return whether the mean of the last decisions is over the threshold, at every row or at `rows`."""
        rows = np.arange(len(x)) if rows is None else rows
        falls = probability_of(self, x, rows)
        return trailing_mean(falls, recording[rows], self.settings.decisions) >= self.threshold_

    def _lessons(self, to_impact: Integers, somebody_moves: Flags) -> tuple[Flags, Flags]:
        """Return the rows that are falling, and the rows for training."""
        tuned = self.settings
        falling = to_impact <= tuned.falling
        share = np.where(somebody_moves, tuned.moving_share, tuned.still_share)
        random = np.random.default_rng(0).random(len(to_impact))
        before_fall = (to_impact > tuned.unclear) & (to_impact < FAR)
        daily = (to_impact >= FAR) & (random < share)
        return falling, falling | before_fall | daily

    def _threshold(self, probability: Floats, recording: Integers) -> float:
        """Return the lowest that so few of these daily recordings reach."""
        mean = trailing_mean(probability, recording, self.settings.decisions)
        _, number = np.unique(recording, return_inverse=True)
        highest = np.zeros(number.max(initial=0) + 1)
        np.maximum.at(highest, number, mean)
        return float(np.quantile(highest, 1.0 - self.settings.false_alarms))


def probability_of(model: Any, x: Features, rows: npt.NDArray[np.intp]) -> Floats:
    """Return the probability of falling at each of `rows`, in parts: scikit-learn copies what it is given."""
    said = np.empty(len(rows))
    for begin in range(0, len(rows), TOGETHER):
        part = slice(begin, begin + TOGETHER)
        said[part] = model.predict_proba(x[rows[part]])[:, 1]
    return said


def trailing_mean(values: Floats, recording: Integers, count: int) -> Floats:
    """Return the mean of each row and the `count` − 1 before it in its recording; before that, 0."""
    total = values.copy()
    for back in range(1, count):
        total[back:] += np.where(recording[back:] == recording[:-back], values[:-back], 0.0)
    return total / count


def fall_trees(settings: FallSettings) -> Any:
    """Return the trees of one fold."""
    return HistGradientBoostingClassifier(
        max_iter=settings.rounds,
        learning_rate=0.1,
        max_leaf_nodes=settings.leaves,
        min_samples_leaf=50,
        l2_regularization=1.0,
        max_features=0.3,
        max_bins=63,
        early_stopping=False,
        random_state=0,
    )
