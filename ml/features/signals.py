"""Signals that do not depend on how a sensor is worn: lengths of vectors, and parts along the vertical.

Arrays are (…, axes, samples) or (…, samples), the windows first; a window never depends on another.
"""

from typing import Final

import numpy as np

from ml.features.windows import Samples

GRAVITY: Final = 9.81  # m/s²
TINY: Final = 1e-9


def length(vectors: Samples) -> Samples:
    """(…, axes, samples) → (…, samples)."""
    lengths: Samples = np.sqrt(_dot(vectors, vectors))
    return lengths


def up(acceleration: Samples) -> Samples:
    """Return the vertical (…, 3, 1) in the sensor's frame.

    The mean specific force over the window points up.
    """
    mean = acceleration.mean(axis=-1, keepdims=True)
    vertical: Samples = mean / np.maximum(np.sqrt((mean * mean).sum(axis=-2, keepdims=True)), TINY)
    return vertical


def along(vectors: Samples, axis: Samples) -> Samples:
    """Return the part of (…, 3, samples) along unit vectors (…, 3, 1): (…, samples)."""
    return _dot(vectors, axis)


def across(vectors: Samples, part: Samples) -> Samples:
    """How long (…, 3, samples) are across an axis along which they have this part: (…, samples)."""
    rest: Samples = np.sqrt(np.maximum(_dot(vectors, vectors) - part * part, 0.0))
    return rest


def _dot(one: Samples, other: Samples) -> Samples:
    """(…, axes, samples) of each → (…, samples): the bits of `(one * other).sum(axis=-2)`, in less time."""
    dot: Samples = one[..., 0, :] * other[..., 0, :]
    for axis in range(1, one.shape[-2]):
        dot += one[..., axis, :] * other[..., axis, :]
    return dot
