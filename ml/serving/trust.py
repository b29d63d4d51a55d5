"""Trust in a robot's predictions: whether its input still resembles the training data."""

import collections
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.features.windows import Samples
from ml.robot.task import ABNORMAL, UNKNOWN
from ml.serving.predictor import Prediction

WITHIN_S: Final = 60  # what is older counts no more
SECOND_NS: Final = 1_000_000_000
FEWEST: Final = 20  # decisions, before which nothing is said
ABNORMAL_SHARE: Final = 0.2  # of the decisions, from which on a robot differs from what was learned from
UNSURE_SHARE: Final = 0.5  # of the decisions that abstain
OUTSIDE_SHARE: Final = 0.05  # of a channel's samples; 0.2 % of those that were learned from are outside

Ranges = Mapping[str, tuple[float, float]]  # of each channel, what nearly all samples learned from were in


class TrustLevel(Enum):
    """In one word, for a person."""

    UNSEEN = "not yet known"  # too few decisions
    GOOD = "good"
    UNSURE = "unsure"  # it abstains more often than not
    DRIFTED = "drifted"  # the robot or its wearer differs from what the model has seen


@dataclass(frozen=True, slots=True)
class Trust:
    """Trust in a model on one robot, by the last minute of decisions.

    `abnormal` and `unknown` are shares of the decisions, `novelty` their mean. `outside` is each
    channel's share of samples that lie where hardly any was that the model has learned from; channels
    without are left out.
    """

    decisions: int = 0
    abnormal: float = 0.0
    unknown: float = 0.0
    novelty: float = 0.0
    outside: Mapping[str, float] = field(default_factory=dict)

    @property
    def drifted(self) -> tuple[str, ...]:
        """The channels whose values are others than those that the model knows, the furthest first."""
        found = {name: share for name, share in self.outside.items() if share > OUTSIDE_SHARE}
        return tuple(sorted(found, key=lambda name: -found[name]))

    @property
    def level(self) -> TrustLevel:
        """Level of trust."""
        if self.decisions < FEWEST:
            return TrustLevel.UNSEEN
        if self.abnormal > ABNORMAL_SHARE or self.drifted:
            return TrustLevel.DRIFTED
        return TrustLevel.UNSURE if self.unknown > UNSURE_SHARE else TrustLevel.GOOD


class _Second:
    """Counts of one second of the robot's clock."""

    def __init__(self, number: int, channels: int) -> None:
        self.number = number
        self.decisions = self.abnormal = self.unknown = 0
        self.novelty = 0.0
        self.outside: npt.NDArray[np.int_] = np.zeros(channels, dtype=np.int_)


class Trusting:
    """One model on one robot; `ranges` of channels that are not known are not judged."""

    def __init__(self, channels: Iterable[str], ranges: Ranges) -> None:
        self._channels = tuple(channels)
        everything = (-np.inf, np.inf)
        self._low, self._high = np.array([ranges.get(name, everything) for name in self._channels]).T
        self.trust = Trust()  # as of the newest whole second
        self._seconds: collections.deque[_Second] = collections.deque(maxlen=WITHIN_S)

    def take(self, predictions: Iterable[Prediction], samples: Iterable[Samples]) -> None:
        """Take what was decided of windows, and each one's newest sample (channels,)."""
        for prediction, sample in zip(predictions, samples, strict=True):
            second = self._second(prediction.stamp_ns // SECOND_NS)
            second.decisions += 1
            second.abnormal += prediction.label == ABNORMAL
            second.unknown += prediction.label == UNKNOWN
            second.novelty += prediction.novelty
            second.outside += (sample < self._low) | (sample > self._high)

    def _second(self, number: int) -> _Second:
        if not self._seconds or self._seconds[-1].number != number:
            self.trust = self._judged(number)
            self._seconds.append(_Second(number, len(self._channels)))
        return self._seconds[-1]

    def _judged(self, now: int) -> Trust:
        seconds = [second for second in self._seconds if now - second.number <= WITHIN_S]
        decisions = sum(second.decisions for second in seconds)
        if not decisions:
            return Trust()
        outside = np.sum([second.outside for second in seconds], axis=0) / decisions
        return Trust(
            decisions,
            sum(second.abnormal for second in seconds) / decisions,
            sum(second.unknown for second in seconds) / decisions,
            sum(second.novelty for second in seconds) / decisions,
            {name: share for name, share in zip(self._channels, outside.tolist(), strict=True) if share},
        )
