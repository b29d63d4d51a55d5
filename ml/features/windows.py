"""Causal windows: the samples of a recording up to each decision, never one after it."""

import numpy as np
import numpy.typing as npt

Samples = npt.NDArray[np.float64]


def windows(samples: Samples, ends: npt.NDArray[np.intp], length: int) -> Samples:
    """(n, channels, length) windows that end with the rows `ends` of (rows, channels) samples."""
    held = np.concatenate([np.repeat(samples[:1], length - 1, axis=0), samples])
    every = np.lib.stride_tricks.sliding_window_view(held, length, axis=0)
    return np.ascontiguousarray(every[ends], dtype=np.float64)
