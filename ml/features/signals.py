"""Signals that do not depend on how a sensor is worn: lengths of vectors, and parts along the vertical.

Arrays are (n, axes, samples) or (n, samples); a row never depends on another.
"""

from typing import Final

import numpy as np

from ml.features.windows import Samples

GRAVITY: Final = 9.81  # m/s²
TINY: Final = 1e-9


def length(vectors: Samples) -> Samples:
    """(n, axes, samples) → (n, samples)."""
    lengths: Samples = np.sqrt(_dot(vectors, vectors))
    return lengths


def up(acceleration: Samples) -> Samples:
    """Return the vertical (n, 3, 1) in the sensor's frame.

    The mean specific force over the window points up.
    """
    mean = acceleration.mean(axis=-1, keepdims=True)
    vertical: Samples = mean / np.maximum(np.sqrt((mean * mean).sum(axis=1, keepdims=True)), TINY)
    return vertical


def along(vectors: Samples, axis: Samples) -> Samples:
    """Return the part of (n, 3, samples) along unit vectors (n, 3, 1): (n, samples)."""
    return _dot(vectors, axis)


def across(vectors: Samples, part: Samples) -> Samples:
    """Return the length of vectors (n, 3, samples) across an axis, by their part along it: (n, samples)."""
    rest: Samples = np.sqrt(np.maximum(_dot(vectors, vectors) - part * part, 0.0))
    return rest


def _dot(one: Samples, other: Samples) -> Samples:
    """(n, axes, samples) of each → (n, samples): the bits of `(one * other).sum(axis=1)`, in less time."""
    dot: Samples = one[:, 0] * other[:, 0]
    for axis in range(1, one.shape[1]):
        dot += one[:, axis] * other[:, axis]
    return dot
