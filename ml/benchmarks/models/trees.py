"""Boosted trees that answer at once: scikit-learn's own prediction starts threads for each small batch."""

import numpy as np
import numpy.typing as npt
from sklearn.ensemble import HistGradientBoostingClassifier

Features = npt.NDArray[np.float32]
Floats = npt.NDArray[np.float64]


class QuickTrees:
    """The probabilities of a fitted `HistGradientBoostingClassifier` without categories, for few rows.

    Every tree goes down a level at once, in a handful of array operations.
    """

    def __init__(self, model: HistGradientBoostingClassifier) -> None:
        rounds = model._predictors  # noqa: SLF001 - scikit-learn has no public way to its boosted trees
        trees = [tree.nodes for one in rounds for tree in one]
        self._first = np.cumsum([0, *(len(nodes) for nodes in trees[:-1])])
        nodes = np.concatenate(trees)
        offsets = np.repeat(self._first, [len(nodes) for nodes in trees])
        leaf = nodes["is_leaf"].astype(bool)
        itself = np.arange(len(nodes))
        # A leaf is its own child, so that short trees wait there for the deep ones.
        self._left = np.where(leaf, itself, nodes["left"] + offsets)
        self._right = np.where(leaf, itself, nodes["right"] + offsets)
        self._feature = np.where(leaf, 0, nodes["feature_idx"]).astype(np.intp)
        self._threshold, self._value = nodes["num_threshold"], nodes["value"]
        self._depth = int(nodes["depth"].max())
        self._outputs = len(rounds[0])
        self._start = np.asarray(model._baseline_prediction, dtype=np.float64).reshape(1, -1)  # noqa: SLF001

    def predict_proba(self, x: Features) -> Floats:
        """(rows, classes), each row's sum is 1. `x` is finite."""
        node = np.repeat(self._first[None], len(x), axis=0)
        for _ in range(self._depth):
            values = np.take_along_axis(x, self._feature[node], axis=1)
            node = np.where(values <= self._threshold[node], self._left[node], self._right[node])
        leaves = self._value[node].reshape(len(x), -1, self._outputs)
        return _probabilities(self._start + leaves.sum(axis=1))


def _probabilities(scores: Floats) -> Floats:
    if scores.shape[1] == 1:
        scores = np.concatenate([np.zeros_like(scores), scores], axis=1)
    powers: Floats = np.exp(scores - scores.max(axis=1, keepdims=True))
    shares: Floats = powers / powers.sum(axis=1, keepdims=True)
    return shares
