"""`--search`: choose the settings again in each fold, by the training subjects alone."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from ml.benchmarks.folds import Rows, grouped

S = TypeVar("S")
Search = bool  # whether the settings are chosen anew, or those fixed in the code are taken
INNER: Final = 3  # folds of training subjects that settings are compared on


def chosen(
    fixed: S,
    grid: Sequence[S],
    groups: npt.NDArray[Any],
    search: Search,
    score: Callable[[S, Rows, Rows], float],
) -> S:
    """Return fixed settings, or the grid's best by mean score over inner folds of whole groups.

    `score(settings, train, judge)` gets rows into `groups`; more is better.
    """
    if not search:
        return fixed
    inner = list(grouped(groups, INNER))
    means = [np.mean([score(settings, train, judge) for train, judge in inner]) for settings in grid]
    return grid[int(np.argmax(means))]


def told(settings: Sequence[S], search: Search) -> str:
    """Return the settings that the folds chose, for the report."""
    if not search:
        return f"fixed: {settings[0]}"
    counts = Counter(map(str, settings)).most_common()
    return "searched: " + "; ".join(f"{one} in {count} of {len(settings)} folds" for one, count in counts)
