"""Boosted trees that answer at once: scikit-learn's own prediction starts threads for each small batch."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from sklearn.ensemble import HistGradientBoostingClassifier

Features = npt.NDArray[np.float32]
Floats = npt.NDArray[np.float64]


class QuickTrees:
    """The probabilities of fitted `HistGradientBoostingClassifier`s without categories, for few rows.

    Every tree of all of them goes down a level at once, in a handful of array operations; those that have
    come to a leaf rest. The probabilities are scikit-learn's, to the rounding of a sum.
    """

    def __init__(self, models: Sequence[HistGradientBoostingClassifier]) -> None:
        trees = [_trees(model) for model in models]
        every = [tree for own in trees for tree in own]
        counts = [len(tree) for tree in every]
        self._first = np.cumsum([0, *counts[:-1]])
        nodes = np.concatenate(every)
        offsets = np.repeat(self._first, counts)
        self._leaf = nodes["is_leaf"].astype(bool)
        children = [np.where(self._leaf, 0, nodes[side] + offsets) for side in ("left", "right")]
        self._child = np.stack(children, axis=1).ravel()
        self._feature = np.where(self._leaf, 0, nodes["feature_idx"]).astype(np.intp)
        self._threshold, self._value = nodes["num_threshold"], nodes["value"]
        # Of each model: its trees' columns, and what its sums begin with.
        ends = np.cumsum([len(own) for own in trees])
        self._columns = [slice(end - len(own), end) for own, end in zip(trees, ends.tolist(), strict=True)]
        self._starts = [
            np.asarray(model._baseline_prediction, dtype=np.float64).reshape(1, -1)  # noqa: SLF001
            for model in models
        ]

    def predict_proba(self, x: Features) -> list[Floats]:
        """Return the probabilities of each model (rows, classes). `x` is finite."""
        values = self._value.take(self._leaves(x)).reshape(len(x), -1)
        return [
            _probabilities(start + values[:, own].reshape(len(x), -1, start.shape[1]).sum(axis=1))
            for own, start in zip(self._columns, self._starts, strict=True)
        ]

    def _leaves(self, x: Features) -> npt.NDArray[np.intp]:
        """Return every row's leaf of every tree, row by row."""
        node = np.tile(self._first, len(x))
        row = np.repeat(np.arange(len(x)) * x.shape[1], len(self._first))
        flat = np.ascontiguousarray(x).ravel()
        going = np.flatnonzero(~self._leaf.take(node))
        here, row = node[going], row[going]
        while len(going):
            right = flat.take(row + self._feature.take(here)) > self._threshold.take(here)
            here = self._child.take(2 * here + right)
            node[going] = here
            on = np.flatnonzero(~self._leaf.take(here))
            going, here, row = going[on], here[on], row[on]
        return node


def _trees(model: HistGradientBoostingClassifier) -> list[npt.NDArray[np.void]]:
    """Return each tree's nodes: scikit-learn has no public way to them."""
    return [tree.nodes for one in model._predictors for tree in one]  # noqa: SLF001


def _probabilities(scores: Floats) -> Floats:
    if scores.shape[1] == 1:
        scores = np.concatenate([np.zeros_like(scores), scores], axis=1)
    powers: Floats = np.exp(scores - scores.max(axis=1, keepdims=True))
    shares: Floats = powers / powers.sum(axis=1, keepdims=True)
    return shares
