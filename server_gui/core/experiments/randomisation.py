"""Randomisation test: differences of pairs against the draw of their order, so no drift is an effect.

If a parameter does nothing, each pair would have given the same two numbers in whatever order its values
came: only the names on them were drawn. So the statistic is computed for every order that might have been
drawn, and p is the share of those in which it is as large as in the one that was. That is exact for any
drift, straight or bent, and for strides that resemble each other, without a model of either (Fisher 1935;
Edgington & Onghena 2007, Randomization Tests, ch. 5).

The statistic is Student's t of the effect in the differences within pairs, beside one straight drift; of many
metrics together, Westfall & Young's step-down maximum (1993, Resampling-Based Multiple Testing, algorithm
4.1): Holm's steps, with the joint distribution of all metrics, which the orders give, for Bonferroni's bound.
The interval is of all effects that the same test, before it is divided by its error, does not exclude.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
CONFIDENCE: Final = 0.95
TINY: Final = 1e-9  # of what binary fractions leave of nothing


@dataclass(frozen=True, slots=True)
class Randomised:
    """Results by metric: difference second minus first, its interval, p adjusted for all metrics."""

    difference: Floats
    low: Floats
    high: Floats
    p: Floats


def randomised(differences: Floats, chosen: npt.NDArray[np.int8], orders: npt.NDArray[np.int8]) -> Randomised:
    """Return the effect, by a randomisation test.

    `differences` has of each pair the later minus the earlier mean (pairs × metrics), `chosen` the order that
    was drawn (1: the first value came first), `orders` all that could be, `chosen` among them.
    """
    drawn = int(np.flatnonzero((orders == chosen).all(axis=1))[0])
    # Of each order its signs, beside a straight drift, which is the same in every pair.
    level = orders - orders.mean(axis=1, keepdims=True)
    power = np.sum(level**2, axis=1, keepdims=True)
    centred = differences - differences.mean(axis=0)
    squares = np.sum(centred**2, axis=0)
    effects = level @ centred / power
    left = np.maximum(squares - effects**2 * power, 0.0) + squares * TINY
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.nan_to_num(np.abs(effects) / np.sqrt(left / power))
    low, high = _interval(effects, drawn, (level / power) @ chosen)
    return Randomised(effects[drawn], low, high, _stepped_down(ratios, drawn))


def _interval(effects: Floats, drawn: int, alike: Floats) -> tuple[Floats, Floats]:
    """Return the effects that are not excluded.

    An order with signs that are `alike` to the drawn one's has so much of an effect too. It speaks for all
    effects from (found - its own) / (1 - alike) to (found + its own) / (1 + alike), in whichever order.
    """
    found, alike = effects[drawn], alike[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        one = np.where(alike < 1.0 - TINY, (found - effects) / (1.0 - alike), -np.inf)
        other = np.where(alike > TINY - 1.0, (found + effects) / (1.0 + alike), np.inf)
    least, most = np.minimum(one, other), np.maximum(one, other)
    least[np.abs(alike[:, 0]) > 1.0 - TINY], most[np.abs(alike[:, 0]) > 1.0 - TINY] = -np.inf, np.inf
    share = 1.0 - CONFIDENCE
    return (
        np.quantile(least, share, axis=0, method="lower"),
        np.quantile(most, 1.0 - share, axis=0, method="higher"),
    )


def _stepped_down(ratios: Floats, drawn: int) -> Floats:
    """Return p of each, for all together: the surest against the largest of all, the next of the others."""
    order = np.argsort(ratios[drawn])
    largest = np.maximum.accumulate(ratios[:, order], axis=1)
    at_least = largest >= ratios[drawn, order] * (1.0 - TINY)
    p = np.empty(len(order))
    p[order] = np.maximum.accumulate(at_least.mean(axis=0)[::-1])[::-1]
    return p
