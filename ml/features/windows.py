"""Causal windows: the samples up to a decision, never one after it; from a recording or from a stream."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ml.features.recipe import Features, Recipe, Samples


def windows(samples: "Samples", ends: npt.NDArray[np.intp], length: int) -> "Samples":
    """(n, channels, length) windows that end with the rows `ends` of (rows, channels) samples."""
    held = np.concatenate([np.repeat(samples[:1], length - 1, axis=0), samples])
    every = np.lib.stride_tricks.sliding_window_view(held, length, axis=0)
    return np.ascontiguousarray(every[ends], dtype=np.float64)


class FeatureStream:
    """The same features, live: push each sample as it comes, ask when a decision is due."""

    def __init__(self, recipe: "Recipe") -> None:
        self._recipe = recipe
        self._ring: Samples | None = None
        self._next = 0

    def push(self, sample: "Samples") -> None:
        """Take one sample (channels,) in the recipe's order."""
        length = self._recipe.look_back
        if self._ring is None:
            self._ring = np.repeat(np.asarray(sample, dtype=np.float64)[:, None], 2 * length, axis=1)
        # Written twice, a length apart, so that the newest `length` samples always lie in one piece.
        self._ring[:, self._next] = self._ring[:, self._next + length] = sample
        self._next = (self._next + 1) % length

    def window(self) -> "Samples":
        """The window (1, channels, look-back) as it is now; those of several robots can be stacked.

        Raises:
            ValueError: no sample has come yet.

        """
        if self._ring is None:
            raise ValueError(f"{self._recipe.name}: no sample has come yet")
        return self._ring[None, :, self._next : self._next + self._recipe.look_back].copy()

    def features(self) -> "Features":
        """(1, features) of the window that ends with the newest sample."""
        return self._recipe.compute(self.window())
