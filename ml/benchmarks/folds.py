"""Folds that never have a subject on both sides, each computed on its own."""

import functools
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from sklearn.model_selection import GroupKFold
from threadpoolctl import threadpool_limits

from ml.neural import fixed_epochs

Rows = npt.NDArray[np.intp]
Split = tuple[Rows, Rows]  # rows to train on, rows to judge by
T = TypeVar("T")
R = TypeVar("R")
TOGETHER: Final = 3  # folds computed at a time: two cores stay busy where the folds are an odd number


def one_left_out(groups: npt.NDArray[Any]) -> Iterator[Split]:
    """Yield a fold for each group."""
    for group in np.unique(groups):
        yield np.flatnonzero(groups != group), np.flatnonzero(groups == group)


def grouped(groups: npt.NDArray[Any], count: int) -> Iterator[Split]:
    """`count` folds of whole groups; as many as there are groups where those are fewer."""
    yield from GroupKFold(min(count, len(np.unique(groups)))).split(groups, groups=groups)


def sharing(windows: npt.NDArray[np.float64]) -> npt.NDArray[np.intp]:
    """Return a number for each window (n, rows, channels).

    Equal where they share a row, also through others.
    """
    count, rows, channels = windows.shape
    _, number = np.unique(windows.reshape(count * rows, channels), axis=0, return_inverse=True)
    pairs = (np.repeat(np.arange(count), rows), count + number.ravel())
    size = count + int(number.max()) + 1
    links = coo_matrix((np.ones(count * rows), pairs), shape=(size, size))
    numbers: Rows = connected_components(links, directed=False)[1][:count].astype(np.intp)
    return numbers


def over(work: Callable[[T], R], folds: Sequence[T]) -> list[R]:
    """Do each fold's work, a few at a time, each on one core; results in the folds' order."""
    # OpenMP counts its threads by the thread that asks, OpenBLAS for the whole process: both are limited.
    one_core = functools.partial(threadpool_limits, limits=1)
    with fixed_epochs(), one_core(), ThreadPoolExecutor(TOGETHER, "fold", initializer=one_core) as pool:
        return list(pool.map(work, folds))
