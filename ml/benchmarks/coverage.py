"""Conformal sets where one subject is left out: each one's limit is by what models said of all the others.

Each subject is judged by models of the others, so that all are judged alike: of such subjects, the share that
is promised keeps within the limit of the others, whatever the models are (`ml.robot.conformal`).
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from ml.robot import conformal

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Subjects = npt.NDArray[Any]
Groups = dict[str, dict[str, float]]


def of_sets(probabilities: Floats, truth: npt.NDArray[np.int_], subject: Subjects) -> tuple[Flags, Flags]:
    """Return whether each decision's set (n,) holds its truth, and whether it is one class, which is said."""
    above, sure = conformal.passed_over(probabilities, truth), probabilities.max(axis=1)
    covered, said = np.zeros(len(truth), dtype=bool), np.zeros(len(truth), dtype=bool)
    for one in np.unique(subject):
        own, others = subject == one, subject != one
        limit = conformal.promised(above[others], sure[others], subject[others]).threshold
        covered[own], said[own] = above[own] < limit, sure[own] >= limit
    return covered, said


def of_intervals(error: Floats, subject: Subjects) -> tuple[Flags, Floats]:
    """Return whether each error (n,) is in its subject's interval, and half the interval's width (n,)."""
    width = np.zeros(len(error))
    for one in np.unique(subject):
        others = subject != one
        width[subject == one] = conformal.reach(np.abs(error[others]), subject[others])
    return np.abs(error) <= width, width


def figures(by_subject: Groups) -> dict[str, float]:
    """Return the worst subject's `covered`, and the number of subjects for whom the promise was kept."""
    covered = [one["covered"] for one in by_subject.values()]
    kept = [one >= conformal.COVERED for one in covered]
    return {
        "covered": float(np.mean(covered)),
        "worst_subject_covered": min(covered),
        "kept_fraction": float(np.mean(kept)),
    }


def of_rows(covered: Flags, said: Flags, right: Flags, rows: Flags) -> dict[str, float]:
    """Return figures of the prediction sets of these decisions."""
    spoken = rows & said
    return {
        "covered": _share(covered[rows]),
        "unknown_fraction": 1.0 - _share(said[rows]),
        "said_accuracy": _share(right[spoken]),
    }


def _share(flags: Flags) -> float:
    return float(flags.mean()) if len(flags) else float("nan")
