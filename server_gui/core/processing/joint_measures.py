"""Measures of one joint: its range of motion, and its tracking error."""

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


class Extremes:
    """The range of an angle since it was last asked for."""

    def __init__(self) -> None:
        self._low, self._high = math.inf, -math.inf

    def take(self, angle: float) -> None:
        """Take one sample."""
        if angle < self._low:
            self._low = angle
        if angle > self._high:
            self._high = angle

    def end(self) -> float | None:
        """Return the range of all samples since the last call, None where there were none."""
        found = self._high - self._low
        self._low, self._high = math.inf, -math.inf
        return found if math.isfinite(found) else None


@dataclass(frozen=True, slots=True)
class Error:
    """Tracking error of a joint (rad)."""

    rms: float
    largest: float
    while_enabled: bool  # only those samples; False: its drive's state was not recorded, so all of them


def tracking_error(error: Floats, state: Floats | None, enabled: Collection[float] | None) -> Error | None:
    """Return the error over all rows in which the drive was enabled; None where there is none.

    `error` (rad) and `state` are as long, NaN where there is no value; `enabled` are the numbers of a state
    in which it follows its target, None: they were not recorded. Where nobody knows when it was enabled, the
    error is over all rows.
    """
    known = ~np.isnan(error)
    told = None if not enabled or state is None or np.isnan(state).all() else state
    if told is not None:
        known &= np.isin(told, list(enabled or ()))
    counted = error[known]
    if not len(counted):
        return None
    rms, largest = float(np.sqrt(np.mean(counted**2))), float(np.max(np.abs(counted)))
    return Error(rms, largest, told is not None)
