"""The normal range of each measure on this robot: mean and spread of the largest value of each second.

A second is learned only after some more seconds without trouble, so that a growing danger does not become
normal. Nothing is taken from other robots or wearers.
"""

import collections
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

BLOCK_S: Final = 1.0
FEWEST: Final = 25  # blocks before a measure is judged
WAITS: Final = 10  # blocks that wait before they are learned
MOST: Final = 3600.0  # blocks in memory: older ones fade
SPREAD: Final = 0.25  # of the mean: the smallest spread assumed
BEYOND: Final = 50.0  # spreads: larger deviations are clipped


class Baseline:
    """Running mean and spread of several measures; `least` (count,) is the smallest spread of each."""

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
        """Take the measures of a moment; return the spreads of each above its mean, NaN where unknown.

        If it is not `quiet`, the blocks that wait to be learned are dropped.
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
        """The measures that have been seen for long enough."""
        known: npt.NDArray[np.bool_] = self._blocks >= FEWEST
        return known
