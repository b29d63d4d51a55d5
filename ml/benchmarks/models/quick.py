"""Scikit-learn's networks and support vectors for few rows at once, without its checks of each call."""

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.distance import cdist
from scipy.special import expit, softmax
from sklearn.pipeline import Pipeline

from ml.neural import within

Features = npt.NDArray[np.float32]
Numbers = npt.NDArray[Any]


def scaled_rows(scale: Pipeline, x: Features) -> Features:
    """Return the rows scaled as `ml.neural.scaled()` does, bit for bit."""
    return within(_standard(scale[0], x))


def _standard(scale: Any, x: Numbers) -> Numbers:
    rows: Numbers = (x - scale.mean_.astype(x.dtype)) / scale.scale_.astype(x.dtype)
    return rows


def outputs(network: Any, inputs: Features) -> Numbers:
    """Return the outputs of a fitted MLP with ReLU, before its last activation; the same bits."""
    values: Numbers = inputs
    last = len(network.coefs_) - 1
    for layer, (weights, bias) in enumerate(zip(network.coefs_, network.intercepts_, strict=True)):
        values = values @ weights
        values += bias
        if layer < last:
            np.maximum(values, 0, out=values)
    return values


def probabilities(network: Any, inputs: Features) -> Numbers:
    """`predict_proba` of a fitted MLPClassifier."""
    found = outputs(network, inputs)
    if found.shape[1] > 1:
        shares: Numbers = softmax(found, axis=1)
        return shares
    ones = expit(found)
    return np.concatenate([1 - ones, ones], axis=1)


class QuickTerrain:
    """`predict` of a fitted `terrain_model`, by its support vectors alone: all others weigh nothing."""

    def __init__(self, model: Pipeline, sharpness: float) -> None:
        self._standard, machine = model[0], model[-1]
        learned = np.asarray(machine._BaseLibSVM__Xfit)  # noqa: SLF001 - a kernel of ours: no public way
        self._vectors = learned[machine.support_]
        self._gamma = sharpness / learned.shape[1]
        self._classes = machine.classes_
        ends = np.cumsum(machine.n_support_)
        self._weights, self._bias = _votes(machine.dual_coef_, ends), machine.intercept_

    def predict(self, x: Numbers) -> Numbers:
        """(rows,) classes: the one that wins most of the duels, of equals the first."""
        apart = cdist(_standard(self._standard, x), self._vectors, "cityblock")
        alike = np.exp(-self._gamma * apart)
        duels = alike @ self._weights + self._bias
        count = len(self._classes)
        wins = np.zeros((len(x), count))
        pairs = [(one, other) for one in range(count) for other in range(one + 1, count)]
        for column, (one, other) in enumerate(pairs):
            won = duels[:, column] > 0
            wins[:, one] += won
            wins[:, other] += ~won
        found: Numbers = self._classes[wins.argmax(axis=1)]
        return found


def _votes(dual: Numbers, ends: Numbers) -> Numbers:
    """(support vectors, duels): libsvm's coefficients, each where its class takes part."""
    begins = np.concatenate([[0], ends[:-1]])
    columns = []
    for one in range(len(ends)):
        for other in range(one + 1, len(ends)):
            weights = np.zeros(dual.shape[1])
            weights[begins[one] : ends[one]] = dual[other - 1, begins[one] : ends[one]]
            weights[begins[other] : ends[other]] = dual[one, begins[other] : ends[other]]
            columns.append(weights)
    return np.stack(columns, axis=1)
