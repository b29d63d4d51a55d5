"""A recipe's regular grid: rows as robots stamp them → samples at multiples of the recipe's period.

A grid point is a multiple of the period on the robot's monotonic clock. Its sample holds each channel's
newest value that is not after it and at most `OLDEST_NS` old (of several at one instant the first); where a
channel has none there is no sample: a gap. What a point holds depends on the rows' stamps alone, and not on
how late one source's rows come behind another's (up to `OLDEST_NS`): a recording gives the samples that there
were live.
"""

import collections
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.features.recipe import Recipe
from ml.features.windows import Samples

OLDEST_NS: Final = 100_000_000  # a value that is older is missing
NEVER_NS: Final = -(2**62)

Stamps = npt.NDArray[np.int64]
Piece = tuple[Stamps, Samples]  # grid points (n,) without a gap, ns; their samples (n, channels)


def period_ns(recipe: Recipe) -> int:
    """Return the time between two points of the recipe's grid."""
    return round(1e9 / recipe.rate_hz)


class Grid:
    """One robot's rows, live. A robot that has booted begins a new grid: its clock begins anew."""

    def __init__(self, recipe: Recipe) -> None:
        self._period_ns = period_ns(recipe)
        # Of each channel the stamp and value that holds at the next point, and those after it.
        self._held = [collections.deque[tuple[int, float]]() for _ in recipe.channels]
        self._newest_ns = [NEVER_NS] * len(recipe.channels)  # of each channel
        self._row_ns = NEVER_NS  # of the newest row
        self._next_ns = _up(NEVER_NS, self._period_ns)

    def push(self, stamp_ns: int, values: Sequence[float | None]) -> list[tuple[int, Samples]]:
        """Take a row, its values in the order of the recipe's channels; the points that it settles.

        Each comes with its sample (channels,). A point is settled when every channel has a value from it on,
        or when a row is `OLDEST_NS` newer. Points that are further apart than the period have a gap between.
        """
        for channel, value in enumerate(values):
            if value is not None and math.isfinite(value) and stamp_ns > self._newest_ns[channel]:
                self._newest_ns[channel] = stamp_ns
                self._held[channel].append((stamp_ns, value))
        self._row_ns = max(self._row_ns, stamp_ns)
        settled_ns = max(min(self._newest_ns), self._row_ns - OLDEST_NS - 1)
        found = []
        while (grid_ns := self._next_ns) <= settled_ns:
            sample = [self._value(held, grid_ns) for held in self._held]
            if None in sample:
                self._next_ns = self._after_gap(grid_ns, settled_ns)
            else:
                self._next_ns += self._period_ns
                found.append((grid_ns, np.array(sample, dtype=np.float64)))
        return found

    def _value(self, held: "collections.deque[tuple[int, float]]", grid_ns: int) -> float | None:
        while len(held) > 1 and held[1][0] <= grid_ns:
            held.popleft()
        there = held and grid_ns - OLDEST_NS <= held[0][0] <= grid_ns
        return held[0][1] if there else None

    def _after_gap(self, grid_ns: int, settled_ns: int) -> int:
        """Return the first point after this one at which no channel is known to be missing."""
        later_ns = grid_ns + self._period_ns
        for held in self._held:
            if self._value(held, grid_ns) is None:
                coming = (stamp_ns for stamp_ns, _ in held if stamp_ns > grid_ns)
                later_ns = max(later_ns, min(next(coming, settled_ns + 1), settled_ns + 1))
        return _up(later_ns, self._period_ns)


def on_grid(recipe: Recipe, stamps_ns: Stamps, values: Samples) -> list[Piece]:
    """Resample a whole recording as `Grid` does: pieces without a gap, in time's order.

    `values` (rows, channels) are in the order of the recipe's channels; what is not finite is missing. Rows
    may come in any order.
    """
    order = np.argsort(stamps_ns, kind="stable")
    stamps_ns, values = stamps_ns[order], values[order]
    there = np.isfinite(values)
    if not there.any(axis=0).all():
        return []
    channels = [stamps_ns[there[:, channel]] for channel in range(values.shape[1])]
    settled_ns = max(min(int(stamps[-1]) for stamps in channels), int(stamps_ns[-1]) - OLDEST_NS - 1)
    grid_ns = _points(stamps_ns, period_ns(recipe), settled_ns)
    samples = np.full((len(grid_ns), len(channels)), np.nan)
    for channel, all_stamps in enumerate(channels):
        stamps, first = np.unique(all_stamps, return_index=True)
        newest = np.searchsorted(stamps, grid_ns, side="right") - 1
        known = (newest >= 0) & (grid_ns - stamps[newest] <= OLDEST_NS)
        samples[known, channel] = values[there[:, channel], channel][first[newest[known]]]
    whole = np.isfinite(samples).all(axis=1)
    grid_ns, samples = grid_ns[whole], samples[whole]
    breaks = np.flatnonzero(np.diff(grid_ns) != period_ns(recipe)) + 1
    pieces = zip(np.split(grid_ns, breaks), np.split(samples, breaks), strict=True)
    return [piece for piece in pieces if len(piece[0])]


def _points(stamps_ns: Stamps, period: int, settled_ns: int) -> Stamps:
    """Every grid point at most `OLDEST_NS` after a row: none in long silences, however long they are."""
    silences = np.flatnonzero(np.diff(stamps_ns) > OLDEST_NS) + 1
    points = [
        np.arange(_up(int(rows[0]), period), min(int(rows[-1]) + OLDEST_NS, settled_ns) + 1, period)
        for rows in np.split(stamps_ns, silences)
    ]
    return np.unique(np.concatenate(points))


def _up(stamp_ns: int, period: int) -> int:
    """Return the first grid point that is not before this."""
    return -(-stamp_ns // period) * period
