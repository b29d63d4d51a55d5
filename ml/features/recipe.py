"""A recipe: which channels a model reads, how far back it looks, and how its features are computed."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.features.windows import Samples, windows

Features = npt.NDArray[np.float32]
CHUNK: Final = 256  # windows computed together: they stay in the processor's cache


@dataclass(frozen=True, slots=True)
class Recipe:
    """Input of a model.

    `compute` takes windows (n, channels, look-back) in SI units, the newest sample last, and returns
    (n, features). A row depends on its own window alone, so that one window alone, a thousand together and
    a stream give the same bits.
    """

    name: str
    rate_hz: float
    look_back: int  # samples
    channels: tuple[str, ...]  # the robot's own names, in the order of the samples' columns
    compute: Callable[[Samples], Features]

    def offered(self, channels: set[str]) -> bool:
        """Whether a robot with these channels has every sensor that this needs."""
        return channels.issuperset(self.channels)


def features(recipe: Recipe, samples: Samples, ends: npt.NDArray[np.intp]) -> Features:
    """Each window's features that ends with (and includes) a row in `ends` of one recording's samples.

    Before a recording's first sample there is nothing to know: that sample is held.
    """
    if not len(ends):
        return features(recipe, samples, np.zeros(1, dtype=np.intp))[:0]
    parts = [
        recipe.compute(windows(samples, ends[at : at + CHUNK], recipe.look_back))
        for at in range(0, len(ends), CHUNK)
    ]
    return np.concatenate(parts)
