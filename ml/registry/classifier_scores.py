"""A classifier's scores on its card: per class and subject, confusion, calibration."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.registry.card import Bin, ClassScore, Metrics

Indices = npt.NDArray[np.int_]
Floats = npt.NDArray[np.float64]

BINS: Final = 10  # of equal width, from 0 to 1


def judged(
    classes: Sequence[str], truth: Indices, probabilities: Floats, label: Indices, subject: Sequence[str]
) -> Metrics:
    """Judge n decisions on data that was not learned from.

    `truth` and `label` (n,) are indices into `classes`, `label` negative where the model abstains;
    `probabilities` (n, classes) are calibrated; `subject` (n,) says whose decision it is. An abstention is no
    right answer, and counts against the recall of its class.
    """
    counts = confusion(len(classes), truth, label)
    scores = {name: _score(counts, at) for at, name in enumerate(classes)}
    subjects = np.asarray(subject)
    calibration = calibrated(probabilities, truth)
    return Metrics(
        figures={
            "macro_f1": _macro_f1(counts),
            "accuracy": float((truth == label).mean()),
            "abstained": float((label < 0).mean()),
        },
        per_class=scores,
        per_subject={
            str(one): _macro_f1(confusion(len(classes), truth[subjects == one], label[subjects == one]))
            for one in np.unique(subjects)
        },
        confusion=tuple(tuple(map(int, row)) for row in counts),
        calibration=calibration,
        calibration_error=sum(abs(one.said - one.right) * one.count for one in calibration) / len(truth),
    )


def confusion(classes: int, truth: Indices, label: Indices) -> Indices:
    """(classes, classes + 1): a row a true class, a column what was said; the last one is "unknown"."""
    counts = np.zeros((classes, classes + 1), dtype=np.int_)
    np.add.at(counts, (truth, np.where(label < 0, classes, label)), 1)
    return counts


def calibrated(probabilities: Floats, truth: Indices) -> tuple[Bin, ...]:
    """Return the likeliest class's probability and accuracy, in bins that are not empty."""
    said, right = probabilities.max(axis=1), probabilities.argmax(axis=1) == truth
    place = np.minimum((said * BINS).astype(np.int_), BINS - 1)
    return tuple(
        Bin(float(said[place == at].mean()), float(right[place == at].mean()), int((place == at).sum()))
        for at in np.unique(place)
    )


def _score(counts: Indices, at: int) -> ClassScore:
    right, said, there = (int(n) for n in (counts[at, at], counts[:, at].sum(), counts[at].sum()))
    return ClassScore(
        precision=right / said if said else 0.0,
        recall=right / there if there else 0.0,
        f1=2 * right / (said + there) if said + there else 0.0,
        support=there,
    )


def _macro_f1(counts: Indices) -> float:
    """Return the mean over the classes that were there or were said."""
    scores = [_score(counts, at) for at in range(len(counts)) if counts[at].any() or counts[:, at].any()]
    return sum(score.f1 for score in scores) / len(scores) if scores else 0.0
