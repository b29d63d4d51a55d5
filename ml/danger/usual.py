"""How large each number usually is on this robot: the largest of each second, its mean and spread.

What is learned waits until some seconds later nothing was wrong, so that a danger does not become usual while
it grows. Nothing of another robot or wearer comes in.
"""

import collections
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

BLOCK_S: Final = 1.0
FEWEST: Final = 25  # blocks, before a number says anything
WAITS: Final = 10  # blocks that wait until it is sure that nothing was wrong
MOST: Final = 3600.0  # blocks that are remembered: what is older fades
SPREAD: Final = 0.25  # of the mean: no number is known better
BEYOND: Final = 50.0  # spreads: more says no more


class Usual:
    """For `count` numbers; `least` (count,) is the smallest spread that they may have."""

    def __init__(self, least: Floats) -> None:
        count = len(least)
        self._least = least
        self._blocks = np.zeros(count)
        self._mean = np.zeros(count)
        self._square = np.zeros(count)
        self._now = np.full(count, -np.inf)
        self._until_s = -np.inf
        self._waiting: collections.deque[Floats] = collections.deque()
        self._spread = np.full(count, np.inf)

    def take(self, at_s: float, numbers: Floats, *, quiet: bool) -> Floats:
        """Take the numbers of a moment; how many spreads each is above its mean, NaN where unknown.

        Where it is not `quiet`, what waits to be learned is forgotten.
        """
        np.fmax(self._now, numbers, out=self._now)
        if not quiet:
            self._waiting.clear()
            self._now.fill(-np.inf)
        elif at_s >= self._until_s:
            self._until_s = at_s + BLOCK_S
            self._waiting.append(self._now.copy())
            self._now.fill(-np.inf)
            if len(self._waiting) > WAITS:
                self._learn(self._waiting.popleft())
        with np.errstate(invalid="ignore"):
            above = (numbers - self._mean) / self._spread
        above[self._blocks < FEWEST] = np.nan
        found: Floats = np.clip(above, 0.0, BEYOND)
        return found

    def _learn(self, block: Floats) -> None:
        told = np.isfinite(block)
        self._blocks[told] = np.minimum(self._blocks[told] + 1.0, MOST)
        share = 1.0 / self._blocks[told]
        off = block[told] - self._mean[told]
        self._mean[told] += share * off
        self._square[told] += share * (off * (block[told] - self._mean[told]) - self._square[told])
        spread = np.sqrt(np.maximum(self._square, 0.0))
        self._spread = np.maximum(np.maximum(spread, SPREAD * np.abs(self._mean)), self._least)

    @property
    def known(self) -> npt.NDArray[np.bool_]:
        """Which numbers have been seen for long enough."""
        known: npt.NDArray[np.bool_] = self._blocks >= FEWEST
        return known
