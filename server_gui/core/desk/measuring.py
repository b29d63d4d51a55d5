"""What is read off a curve: its values at two cursors, and how it is between two times."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
NEAR: Final = 1.5  # usual distances of two rows, within which a row is told for an instant


@dataclass(frozen=True, slots=True)
class Measured:
    """One curve, in its own unit; None where it has no value. `sd` is the standard deviation."""

    a: float | None
    b: float | None
    low: float | None = None
    high: float | None = None
    mean: float | None = None
    sd: float | None = None


def nearest(times: Floats, at_s: float) -> int | None:
    """Return the row whose time is nearest to `at_s` (s, `times` rising); None where there is none."""
    if not len(times):
        return None
    after = min(int(np.searchsorted(times, at_s)), len(times) - 1)
    before = max(after - 1, 0)
    return before if at_s - times[before] <= times[after] - at_s else after


def row_at(times: Floats, at_s: float) -> int | None:
    """Return the row that is told at `at_s`; None in a gap, and before or after all rows: there is none."""
    row = nearest(times, at_s)
    apart_s = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    return None if row is None or abs(times[row] - at_s) > NEAR * apart_s else row


def measure(values: Floats, a: int | None, b: int | None, first: int, last: int) -> Measured:
    """Return the values at rows `a` and `b`, and how they are from row `first` until before row `last`."""
    at_a, at_b = (None if row is None or np.isnan(values[row]) else float(values[row]) for row in (a, b))
    known = values[first:last]
    known = known[~np.isnan(known)]
    if not len(known):
        return Measured(at_a, at_b)
    low, high = float(known.min()), float(known.max())
    if low == high:  # of equal values the sums are not exact
        return Measured(at_a, at_b, low, high, low, 0.0)
    return Measured(at_a, at_b, low, high, float(known.mean()), float(known.std()))
