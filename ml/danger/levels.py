"""The four levels of danger, with thresholds from budgets of false alarms, and hysteresis."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

import numpy as np
import numpy.typing as npt

RELEASE: Final = 0.7  # below its threshold (log odds) a level ends …
CALM_S: Final = 1.5  # … after so long
HOLD: Final = 2  # samples one after the other at which a level begins


class Level(IntEnum):
    """Urgency; UNKNOWN is not NONE: there is too little data to judge."""

    UNKNOWN = -1
    NONE = 0
    EARLY = 1  # worth a look when there is time
    ADVICE = 2  # look now
    ALARM = 3  # act now
    STOP = 4  # stop the robot, where the user's file has a rule that says so

    @property
    def word(self) -> str:
        """The level's name in reports."""
        return _WORDS[self]


_WORDS: Final = {
    Level.UNKNOWN: "unknown",
    Level.NONE: "none",
    Level.EARLY: "early warning",
    Level.ADVICE: "advice",
    Level.ALARM: "alarm",
    Level.STOP: "stop",
}
URGENT: Final = (Level.EARLY, Level.ADVICE, Level.ALARM, Level.STOP)


def sustained(odds: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the log odds that `HOLD` samples in a row reached (n,): thresholds up to it are met."""
    found = odds.copy()
    for before in range(1, HOLD):
        np.minimum(found[before:], odds[:-before], out=found[before:])
    return found


class Levels:
    """The level of one robot from moment to moment; `thresholds` rise with the level, in log odds."""

    def __init__(self, thresholds: Mapping[Level, float]) -> None:
        self.level = Level.NONE
        self._thresholds = thresholds
        self._above = dict.fromkeys(URGENT, 0)
        self._calm_s: float | None = None  # since when it is below what its level needs

    @property
    def is_met(self) -> bool:
        """Whether the newest moment is one that keeps its level, and none of those after which it falls."""
        return self._calm_s is None

    def take(self, at_s: float, odds: float) -> Level:
        """Take the log odds of a moment."""
        for level in URGENT:
            self._above[level] = self._above[level] + 1 if odds >= self._thresholds[level] else 0
        wanted = max((level for level in URGENT if self._above[level] >= HOLD), default=Level.NONE)
        if wanted >= self.level:
            self.level, self._calm_s = wanted, None
        elif odds >= self._thresholds[self.level] - RELEASE:
            self._calm_s = None
        elif self._calm_s is None:
            self._calm_s = at_s
        elif at_s - self._calm_s >= CALM_S:
            self.level, self._calm_s = wanted, None
        return self.level
