"""A small neural network's outputs, row by row with the same bits: scikit-learn's own depend on the batch."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

Rows = npt.NDArray[np.float32]

FAR: Final = 5.0  # standard deviations, beyond which a feature tells a network no more


def outputs(network: Any, inputs: Rows) -> Rows:
    """(n, outputs) of a fitted MLPClassifier or MLPRegressor with ReLU, before its last activation."""
    values = np.clip(inputs, -FAR, FAR)
    last = len(network.coefs_) - 1
    for layer, (weights, bias) in enumerate(zip(network.coefs_, network.intercepts_, strict=True)):
        values = np.einsum("ij,jk->ik", values, weights) + bias
        if layer < last:
            values = np.maximum(values, 0.0)
    return values
