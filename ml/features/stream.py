"""The same features, live: one robot's newest samples."""

import numpy as np

from ml.features.recipe import Features, Recipe
from ml.features.windows import Samples


class FeatureStream:
    """Push each sample as it comes, ask when a decision is due."""

    def __init__(self, recipe: "Recipe") -> None:
        self._recipe = recipe
        self._samples: Samples | None = None  # (channels, twice the look-back), of which …
        self._end = 0  # … so many have come

    def push(self, sample: Samples) -> None:
        """Take one sample (channels,) in the recipe's order."""
        if self._samples is None:
            first = np.asarray(sample, dtype=np.float64)[:, None]
            self._samples = self._room(np.repeat(first, self._recipe.look_back, axis=1))
        elif self._end == self._samples.shape[1]:
            self._samples = self._room(self._samples[:, -self._recipe.look_back :])
        self._samples[:, self._end] = sample
        self._end += 1

    def _room(self, held: Samples) -> Samples:
        """Return new memory, half of it taken by what is held: windows of the old one stay what they were."""
        room = np.empty((len(held), 2 * held.shape[1]))
        self._end = held.shape[1]
        room[:, : self._end] = held
        return room

    def window(self) -> Samples:
        """Return the window (1, channels, look-back) as it is now; those of several robots can be stacked.

        It is not copied, as what has come is never overwritten.

        Raises:
            ValueError: no sample has come yet.

        """
        if self._samples is None:
            raise ValueError(f"{self._recipe.name}: no sample has come yet")
        window = self._samples[None, :, self._end - self._recipe.look_back : self._end]
        window.flags.writeable = False
        return window

    def features(self) -> Features:
        """(1, features) of the window that ends with the newest sample."""
        return self._recipe.compute(self.window())
