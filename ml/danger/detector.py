"""What a detector of danger is: it measures what is unusual, and says it in words."""

from collections.abc import Sequence
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from ml.danger.now import Now

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
    """One way to see danger coming; it knows one robot alone.

    `measure` gives a number for each of `keys`, larger where it looks more dangerous, NaN where what it needs
    is missing. `needs` says in words what that is. How large is usual is learned by `ml.danger.usual`, from
    this robot's own healthy time; `least` is what a number has to differ from that at least, in its unit.
    """

    @property
    def name(self) -> str: ...

    @property
    def keys(self) -> Sequence[str]: ...

    @property
    def least(self) -> Floats: ...

    @property
    def needs(self) -> str: ...

    def measure(self, now: Now, *, learn: bool) -> Floats:
        """Take the next sample; models of what is usual follow it where they may `learn`."""

    def words(self, key: str) -> str:
        """Say what is wrong where this key is the worst."""
