"""The same features, live: a ring of one robot's newest samples."""

import numpy as np

from ml.features.recipe import Features, Recipe
from ml.features.windows import Samples


class FeatureStream:
    """Push each sample as it comes, ask when a decision is due."""

    def __init__(self, recipe: "Recipe") -> None:
        self._recipe = recipe
        self._ring: Samples | None = None
        self._next = 0

    def push(self, sample: Samples) -> None:
        """Take one sample (channels,) in the recipe's order."""
        length = self._recipe.look_back
        if self._ring is None:
            self._ring = np.repeat(np.asarray(sample, dtype=np.float64)[:, None], 2 * length, axis=1)
        # Written twice, a length apart, so that the newest `length` samples always lie in one piece.
        self._ring[:, self._next] = self._ring[:, self._next + length] = sample
        self._next = (self._next + 1) % length

    def window(self) -> Samples:
        """Return the window (1, channels, look-back) as it is now; those of several robots can be stacked.

        Raises:
            ValueError: no sample has come yet.

        """
        if self._ring is None:
            raise ValueError(f"{self._recipe.name}: no sample has come yet")
        return self._ring[None, :, self._next : self._next + self._recipe.look_back].copy()

    def features(self) -> Features:
        """(1, features) of the window that ends with the newest sample."""
        return self._recipe.compute(self.window())
