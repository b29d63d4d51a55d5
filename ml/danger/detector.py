"""The interface of a detector of danger: it measures deviations from normal, and names them in words."""

from collections.abc import Sequence
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from ml.danger.observation import Observation

Floats = npt.NDArray[np.float64]

DETECTORS: Final = (
    "tracking",
    "torque",
    "strides",
    "support",
    "balance",
    "rhythm",
    "agreement",
    "drift",
    "creep",
    "set-points",
    "effort",
    "loads",
    "lean",
)


class Detector(Protocol):
    """One method to detect danger early, on a single robot.

    `measure` returns a number for each of `keys`: the larger, the more dangerous; NaN without its input.
    `needs` names this input in words. `ml.danger.baseline` learns the normal range of each number from this
    robot's own healthy time; `least` is the smallest deviation that counts, in the number's unit.
    """

    @property
    def name(self) -> str: ...

    @property
    def keys(self) -> Sequence[str]: ...

    @property
    def least(self) -> Floats: ...

    @property
    def needs(self) -> str: ...

    def measure(self, now: Observation, *, learn: bool) -> Floats:
        """Take the next sample; models of the normal state follow it if they may `learn`."""

    def words(self, key: str) -> str:
        """Return the problem in words, if this key deviates most."""
