"""Slopes that outliers do not bend: Theil–Sen with Sen's confidence interval."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
FEWEST = 8  # points; with fewer, no interval of 95 % says anything


@dataclass(frozen=True, slots=True)
class Slope:
    """A slope in units of y per unit of x, and the 95 % confidence interval around it."""

    value: float
    low: float
    high: float


def theil_sen(x: Floats, y: Floats) -> Slope | None:
    """Return the median of the slopes between all pairs of points; None for fewer than `FEWEST` of them.

    The interval is Sen's (1968, J. Am. Stat. Assoc. 63, 1379): ranks of the sorted slopes around the middle,
    by the variance of Kendall's S with its correction for ties. It takes the points' errors for independent.
    """
    from scipy.stats import theilslopes  # takes as long to import as a view to open, and is seldom asked

    if len(x) < FEWEST or np.ptp(x) == 0.0:
        return None
    found = theilslopes(y, x, 0.95)
    return Slope(float(found.slope), float(found.low_slope), float(found.high_slope))


def rank_sum_p(a: Floats, b: Floats) -> float:
    """Two-sided p that two samples are of the same size (Mann–Whitney U, normal with ties and continuity)."""
    from scipy.stats import mannwhitneyu

    if not len(a) or not len(b) or np.ptp(np.concatenate((a, b))) == 0.0:
        return 1.0
    return float(mannwhitneyu(a, b, method="asymptotic").pvalue)
