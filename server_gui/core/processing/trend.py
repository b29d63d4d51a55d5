"""Slopes that outliers do not bend: Theil–Sen with Sen's confidence interval."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
FEWEST = 8  # points; with fewer, no interval of 95 % says anything
Z95 = 1.959964


@dataclass(frozen=True, slots=True)
class Slope:
    """A slope in units of y per unit of x, and the 95 % confidence interval around it."""

    value: float
    low: float
    high: float


def theil_sen(x: Floats, y: Floats) -> Slope | None:
    """The median of the slopes between all pairs of points; None for fewer than `FEWEST` of them.

    The interval is Sen's (1968, J. Am. Stat. Assoc. 63, 1379): ranks of the sorted slopes around the middle,
    by the variance of Kendall's S with its correction for ties. It takes the points' errors for independent.
    """
    if len(x) < FEWEST:
        return None
    first, second = np.triu_indices(len(x), 1)
    steps = x[second] - x[first]
    apart = steps != 0.0
    slopes = np.sort((y[second] - y[first])[apart] / steps[apart])
    if not len(slopes):
        return None
    reach = Z95 * math.sqrt(_kendall_variance(y))
    low = max(0, math.floor((len(slopes) - reach) / 2))
    high = min(len(slopes) - 1, math.ceil((len(slopes) + reach) / 2))
    return Slope(float(np.median(slopes)), float(slopes[low]), float(slopes[high]))


def _kendall_variance(y: Floats) -> float:
    n = len(y)
    ties = np.unique(y, return_counts=True)[1].astype(np.float64)
    tied = float(np.sum(ties * (ties - 1.0) * (2.0 * ties + 5.0)))
    return max(0.0, (n * (n - 1) * (2 * n + 5) - tied) / 18.0)


def rank_sum_p(a: Floats, b: Floats) -> float:
    """Two-sided p that two samples are of the same size (Mann–Whitney U, normal with ties and continuity)."""
    n, m = len(a), len(b)
    if not n or not m:
        return 1.0
    both = np.concatenate((a, b))
    values, places, counts = np.unique(both, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    ranks = ((ends - counts) + (ends + 1)) / 2.0
    u = float(np.sum(ranks[places][:n])) - n * (n + 1) / 2.0
    ties = float(np.sum(counts.astype(np.float64) ** 3 - counts))
    total = n + m
    variance = n * m / 12.0 * ((total + 1) - ties / (total * (total - 1)))
    if variance <= 0.0 or len(values) < 2:
        return 1.0
    z = max(0.0, abs(u - n * m / 2.0) - 0.5) / math.sqrt(variance)
    return math.erfc(z / math.sqrt(2.0))
