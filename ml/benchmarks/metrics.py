"""Building blocks of a benchmark's figures."""

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int_]
Floats = npt.NDArray[np.float64]


def confusion(truth: Integers, predicted: Integers, classes: int) -> Integers:
    """(classes, classes) counts: rows are the truth, columns what was predicted."""
    counts = np.zeros((classes, classes), dtype=np.int_)
    np.add.at(counts, (truth, predicted), 1)
    return counts


def f1_by_class(counts: Integers) -> Floats:
    """F1 of each class; NaN where a class neither is nor was predicted."""
    hits = np.diag(counts).astype(np.float64)
    total = counts.sum(axis=0) + counts.sum(axis=1)
    with np.errstate(invalid="ignore"):
        f1: Floats = 2.0 * hits / total
    return f1


def macro_f1(truth: Integers, predicted: Integers, classes: int) -> float:
    """Return the mean F1 over the classes that are there or were predicted."""
    return float(np.nanmean(f1_by_class(confusion(truth, predicted, classes))))


def accuracy(truth: Integers, predicted: Integers) -> float:
    return float((truth == predicted).mean())


def matches(true: Integers, found: Integers, within: int) -> int:
    """Count found events (sorted) within so many samples of a true one (sorted), one to one."""
    place = other = hits = 0
    while place < len(true) and other < len(found):
        apart = found[other] - true[place]
        hits += abs(apart) <= within
        place += apart >= -within
        other += apart <= within
    return hits


def circular_error(phase: Floats, truth: Floats) -> Floats:
    """Return the shorter way round from `truth` to `phase`, both in cycles: −0.5 up to 0.5."""
    error: Floats = (phase - truth + 0.5) % 1.0 - 0.5
    return error


def rms(errors: Floats) -> float:
    return float(np.sqrt((errors**2).mean()))
