"""Size and certainty of a step in a number that varies from cycle to cycle.

Linear least squares: what counts is the coefficient of `step` beside everything else in `design`, such as a
trend in time (a drift is not an effect) and the stride's time (equal speed). Cycles that follow each other
are alike, so the error of that coefficient comes from a block bootstrap of the residuals: circular blocks
(Politis & Romano 1992), drawn before and after the step each for itself, whose length follows from the
residuals' correlation (Carlstein 1986, Ann. Statist. 14, 1171). The coefficient is a weighted sum of the
residuals, and blocks are drawn independently: the bootstrap's variance is a sum over blocks that can be
computed instead of drawn. It is the limit of endlessly many draws, costs less than a hundred of them, and is
the same each time.

Blocks of a few dozen cycles are too short for what resembles its neighbours for long, and a side of ten
cycles has hardly any residuals left once a line was drawn through it. So the error is at least what it would
be of errors of first order autoregression, whose correlation is corrected for what the regression takes of it
(Marriott & Pope 1954, Biometrika 41, 390). It is no smaller than the middle one of all metrics: that the
least correlated one of sixty looks so by chance is no reason to be surer of it.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

CONFIDENCE: Final = 0.95
FEWEST_DEGREES: Final = 3.0  # of freedom: with fewer blocks nothing is said
MOST_CORRELATION: Final = 0.9
OVERLAPPING: Final = 1.5  # blocks that overlap tell so much more of a variance (Meketon & Schmeiser 1984)


@dataclass(frozen=True, slots=True)
class Effects:
    """The step's coefficient of each column, its standard error and degrees of freedom, and what follows."""

    difference: Floats
    error: Floats
    degrees: Floats
    spread: Floats  # standard deviation of the residuals: of cycles that nothing has changed
    blocks: npt.NDArray[np.int64]  # cycles a block

    @property
    def half_width(self) -> Floats:
        """Half of the confidence interval."""
        from scipy.special import stdtrit  # who only shows evidence has no scipy

        return np.asarray(stdtrit(self.degrees, 0.5 + CONFIDENCE / 2.0) * self.error)

    @property
    def p(self) -> Floats:
        """Probability of a difference at least so large by chance."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.nan_to_num(np.abs(self.difference) / self.error, posinf=np.inf)
        from scipy.special import stdtr  # as above

        return np.asarray(2.0 * stdtr(self.degrees, -ratio))

    @property
    def size(self) -> Floats:
        """The difference in standard deviations (Cohen's d)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.spread > 0.0, self.difference / self.spread, 0.0)


def effects(values: Floats, step: Floats, design: Floats, after: Bools) -> Effects:
    """Return the effects of `step` on each column of `values` (cycles × metrics), all in the order of time.

    `design` has what else explains them, the constant among it (cycles × terms); `after` says on which side
    of the step each cycle is.
    """
    regressors = np.column_stack([design, step])
    inverse = np.linalg.pinv(regressors)
    residuals = values - regressors @ (inverse @ values)
    least, least_degrees = _autoregressive(residuals, inverse[-1], regressors, after)
    leverage = np.clip(np.einsum("nt,tn->n", regressors, inverse), 0.0, 0.95)
    residuals /= np.sqrt(1.0 - leverage)[:, None]  # as spread as the errors that they stand for
    terms = regressors.shape[1]
    blocks = block_lengths(residuals, after)
    variance = np.zeros(values.shape[1])
    number = np.zeros(values.shape[1])
    for length in np.unique(blocks):
        chosen = blocks == length
        for side in (after, ~after):
            part = residuals[side][:, chosen]
            variance[chosen] += bootstrap_variance(part, inverse[-1, side], int(length))
            number[chosen] += len(part) / length
    spread = np.sqrt(np.mean(residuals**2, axis=0))
    degrees = np.minimum(OVERLAPPING * number - terms, least_degrees)
    error = np.sqrt(np.maximum(variance, least))
    return Effects(inverse[-1] @ values, error, np.maximum(degrees, FEWEST_DEGREES), spread, blocks)


def _autoregressive(
    residuals: Floats, weights: Floats, regressors: Floats, after: Bools
) -> tuple[Floats, Floats]:
    """Return the variance of Σ weight · error where errors keep a part of the one before.

    Its degrees of freedom.
    """
    cycles, terms = regressors.shape
    seen = _correlation(residuals, after)
    kept, seen = map(_together, ((seen * cycles + terms) / max(cycles - terms - 2, 1), seen))
    basis = np.column_stack([weights, np.linalg.svd(regressors, full_matrices=False)[0]])
    sums = np.array([_alike(basis, one) for one in kept.tolist()])
    power = np.sum(residuals**2, axis=0) / np.maximum(cycles - np.sum(sums[:, 1:], axis=1), 1.0)
    degrees = (cycles - terms) * (1.0 - seen**2) / (1.0 + seen**2)
    return np.asarray(power * sums[:, 0]), np.asarray(degrees)


def _together(correlations: Floats) -> Floats:
    """Return each metric's own correlation, but at least the median of all."""
    clipped = np.clip(correlations, 0.0, MOST_CORRELATION)
    return np.asarray(np.maximum(clipped, np.median(clipped)))


def _alike(columns: Floats, kept: float) -> Floats:
    """Σ Σ x_i x_j kept^|i − j| of each column x."""
    from scipy.signal import lfilter  # as above

    return np.asarray(
        np.sum(columns * (2.0 * lfilter([1.0], [1.0, -kept], columns, axis=0) - columns), axis=0)
    )


def _correlation(residuals: Floats, after: Bools) -> Floats:
    """Return the correlation of neighbours on the same side; 0 for constant columns."""
    pairs = after[1:] == after[:-1]
    power = np.sum(residuals**2, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        together = np.sum((residuals[1:] * residuals[:-1])[pairs], axis=0) / power
    return np.asarray(np.nan_to_num(together, posinf=0.0, neginf=0.0))


def bootstrap_variance(residuals: Floats, weights: Floats, length: int) -> Floats:
    """Return the variance of Σ weight · residual over circular blocks of so many cycles, for each column."""
    cycles = len(residuals)
    length = min(length, cycles)
    starts = (np.arange(cycles)[:, None] + np.arange(length)) % cycles
    centred = residuals - residuals.mean(axis=0)
    pieces = -(-cycles // length)
    padded = np.zeros(pieces * length)
    padded[:cycles] = weights
    sums = np.einsum("pl,slk->psk", padded.reshape(pieces, length), centred[starts])
    correction = cycles / max(cycles - length, 1)  # residuals that add up to nothing vary too little
    return np.asarray(sums.var(axis=1).sum(axis=0) * correction)


def block_lengths(residuals: Floats, after: Bools) -> npt.NDArray[np.int64]:
    """Return the block length of each column in cycles: 1 if none resembles its neighbour."""
    correlation = np.clip(np.abs(_correlation(residuals, after)), 0.0, MOST_CORRELATION)
    cycles = len(residuals)
    best: Floats = (6.0 * (correlation / (1.0 - correlation**2)) ** 2 * cycles) ** (1.0 / 3.0)
    most = max(1, int(min(np.sum(after), np.sum(~after))) // 4)
    return np.asarray(np.minimum(np.maximum(np.ceil(best), 1.0), most), dtype=np.int64)


def holm(p: Floats) -> Floats:
    """Return p adjusted for so many looks: the chance that any of them errs stays (Holm 1979)."""
    order = np.argsort(p)
    factors = len(p) - np.arange(len(p))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(np.maximum.accumulate(p[order] * factors), 1.0)
    return adjusted
