"""Thresholds from budgets: the lowest odds that keep false alarms an hour of healthy walking within a budget.

If the recorded hours are too few to show such a small budget, the tail of the healthy maxima is extrapolated
as an exponential, the limit of most tails (Coles 2001, §4): an estimate, blind to events never recorded.
"""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.stats import beta, chi2

from ml.danger.levels import URGENT, Level

Floats = npt.NDArray[np.float64]

BUDGETS: Final[Mapping[Level, float]] = {
    Level.EARLY: 6.0,
    Level.ADVICE: 0.5,  # the goal is 1: chance in few hours is not to exceed it
    Level.ALARM: 0.1,
    Level.STOP: 0.01,
}
BLOCK_S: Final = 10.0  # an alarm in this time is one alarm
TAIL: Final = 0.1  # share of the blocks whose maxima are its tail
APART: Final = 0.1  # log odds between two levels at least


def thresholds(maxima: Floats, hours: float) -> dict[Level, float]:
    """Return log odds by level, from the `maxima` of the blocks of so many healthy hours."""
    ordered = np.sort(maxima)[::-1]
    count, base, scale = _tail(ordered)
    found: dict[Level, float] = {}
    least = -np.inf
    for level in URGENT:
        tail = base + scale * np.log(count / (BUDGETS[level] * hours))
        # Never lower than on the recorded hours, where there may be no more alarms than the budget allows.
        allowed = int(BUDGETS[level] * hours)
        seen = ordered[allowed] if allowed < len(ordered) else ordered[-1]
        found[level] = least = float(max(tail, seen + 1e-6, least + APART))
    return found


def extrapolated(maxima: Floats, hours: float, odds: float) -> float:
    """Return the rate an hour at which such log odds are reached, by the same tail; NaN without maxima."""
    if not len(maxima):
        return math.nan
    count, base, scale = _tail(np.sort(maxima)[::-1])
    return float(count / hours * np.exp(min((base - odds) / scale, 0.0)))


def _tail(ordered: Floats) -> tuple[int, float, float]:
    """Return the number of maxima in the tail (the largest come first), its start and its scale."""
    count = max(int(TAIL * len(ordered)), min(5, len(ordered)))
    base = float(ordered[count - 1])
    return count, base, max(float(np.mean(ordered[:count] - base)), APART)


def rate_interval(events: int, hours: float) -> tuple[float, float]:
    """Return the 95 % interval of a rate an hour (Garwood 1936); with none seen, at most 3.7 / hours.

    NaN of no hours.
    """
    if not hours:
        return math.nan, math.nan
    low = chi2.ppf(0.025, 2 * events) / 2.0 / hours if events else 0.0
    return float(low), float(chi2.ppf(0.975, 2 * (events + 1)) / 2.0 / hours)


def rule_of_three(events: int, hours: float) -> float:
    """Return the 95 % upper bound of a rate an hour, one-sided: 3 / hours if none was seen, NaN of none."""
    if not hours:
        return math.nan
    return float(chi2.ppf(0.95, 2 * (events + 1)) / 2.0 / hours)


def share_interval(hits: int, of: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Clopper & Pearson 1934)."""
    low = beta.ppf(0.025, hits, of - hits + 1) if hits else 0.0
    return float(low), float(beta.ppf(0.975, hits + 1, of - hits) if hits < of else 1.0)
