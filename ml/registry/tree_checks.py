"""Trees as they must be: scikit-learn follows a tree's numbers in compiled code, without looking."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.ensemble import HistGradientBoostingClassifier

from ml.errors import UnusableModel


def check_trees(state: Any) -> None:
    """Refuse boosted trees that lead out of themselves, round in a circle, or to features that are not there.

    Raises:
        UnusableModel: there are such.

    """
    for model in _boosted(state):
        rounds = getattr(model, "_predictors", ())  # none where it has not learned, as within a vote
        for tree in (tree for one in rounds for tree in one):
            _check(tree.nodes, model.n_features_in_)


def _boosted(part: Any) -> Iterator[Any]:
    """Yield every model of boosted trees within."""
    if isinstance(part, HistGradientBoostingClassifier):
        yield part
    elif isinstance(part, dict):
        for each in part.values():
            yield from _boosted(each)
    elif isinstance(part, list | tuple):
        for each in part:
            yield from _boosted(each)
    elif type(part).__module__.startswith("sklearn.") and hasattr(part, "__dict__"):
        yield from _boosted(vars(part))


def _check(nodes: npt.NDArray[Any], features: int) -> None:
    inner = np.flatnonzero(nodes["is_leaf"] == 0)
    children = np.stack([nodes["left"][inner], nodes["right"][inner]])
    if (
        not len(nodes)
        or (children <= inner).any()  # a child always comes after its parent
        or (children >= len(nodes)).any()
        or (nodes["feature_idx"][inner] >= features).any()
        or (nodes["feature_idx"][inner] < 0).any()
        or nodes["is_categorical"].any()
    ):
        raise UnusableModel("its trees lead nowhere: the file is damaged, or was made to do harm")
