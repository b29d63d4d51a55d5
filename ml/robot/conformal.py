"""Conformal thresholds: how sure a model must be, so that its sets cover the truth of new wearers.

A prediction's set holds the likeliest classes, until their probabilities together reach the threshold; where
it is one class alone, the model says that. Wearers are what is exchangeable, not decisions: one wearer's are
alike. So each left-out wearer counts once, with the least threshold at which enough of his decisions' sets
would have held the truth; the threshold is the conformal quantile of those over wearers (Dunn, Wasserman and
Ramdas, "Distribution-free prediction sets for two-layer hierarchical models"; Duchi, Gupta, Jiang and Sur,
"Predictive inference in multi-environment scenarios").
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

COVERED: Final = 0.95  # of a wearer's decisions: those whose set holds the truth
WEARERS: Final = 0.9  # of new wearers, of whom so many are covered
MOST_ABSTAINED: Final = 0.1  # of all decisions: where it would take more, less is promised, and that is told
LEAST_SURE: Final = 0.5  # what is as likely wrong as right is never said, however little is promised


@dataclass(frozen=True, slots=True)
class Promise:
    """From which probability on a model speaks, and what then holds.

    With the probability `wearers` the sets of a new wearer, who is like another draw of those that were left
    out, hold the truth in a share of `covered` of his decisions at least.
    """

    threshold: float  # above 1 it never speaks
    covered: float
    wearers: float


def promised(above: Floats, sure: Floats, group: npt.NDArray[Any]) -> Promise:
    """Return the promise that n decisions about left-out people allow.

    `above` (n,) is what was thought likelier than the truth, as `passed_over` gives it, `group` (n,) whose
    decision it is: k people. Nobody can promise anything to more than k in k + 1 new ones. `sure` (m,) is the
    probability of what would be said, of the decisions in which there is something to say.
    """
    most = float(np.sort(sure)[int(MOST_ABSTAINED * len(sure))])
    threshold = max(LEAST_SURE, min(float(np.nextafter(reach(above, group), np.inf)), most))
    people = np.unique(group)
    missed = [float((above[group == one] >= threshold).mean()) for one in people]
    share = min(WEARERS, len(people) / (len(people) + 1))
    return Promise(threshold, 1.0 - sorted(missed)[_rank(len(people)) - 1], share)


def reach(values: Floats, group: npt.NDArray[Any]) -> float:
    """Return the bound for `COVERED` of a new wearer's values, with probability `WEARERS`.

    `values` (n,) are of k people, `group` (n,). Of few people it is what the worst one's keep within, which
    holds with the probability k / (k + 1) alone.
    """
    kept = sorted(_quantile(values[group == one]) for one in np.unique(group))
    return kept[_rank(len(kept)) - 1]


def passed_over(probabilities: Floats, truth: npt.NDArray[np.int_]) -> Floats:
    """(n,): the probability of all classes that come before the true one, of (n, classes)."""
    above: Floats = np.take_along_axis(_above(probabilities), truth[:, None], axis=1)[:, 0]
    return above


def together(probabilities: Floats, threshold: float) -> Flags:
    """(n, classes): which are in the set; one alone exactly where it is as probable as the threshold."""
    return _above(probabilities) < threshold


def _above(probabilities: Floats) -> Floats:
    """(n, classes): what the likelier classes of a row have together."""
    order = np.argsort(-probabilities, axis=1, kind="stable")
    sums = np.cumsum(np.take_along_axis(probabilities, order, axis=1), axis=1)
    sums = np.concatenate([np.zeros((len(sums), 1)), sums[:, :-1]], axis=1)
    above = np.empty_like(probabilities)
    np.put_along_axis(above, order, sums, axis=1)
    return above


def _quantile(values: Floats) -> float:
    return float(np.sort(values)[math.ceil(COVERED * len(values)) - 1])


def _rank(people: int) -> int:
    """Return the rank of the person whose values count, from the best one on: 1 up to `people`."""
    return min(math.ceil((people + 1) * WEARERS), people)
