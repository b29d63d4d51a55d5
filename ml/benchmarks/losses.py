"""Packets lost on purpose: how figures hold where a share of what sensors send never comes."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

SHARES: Final = (0.05, 0.2)  # of every sensor's packets, beside none


def lossy(samples: Floats, sensors: Sequence[int], share: float, seed: int) -> Floats:
    """(…, channels) samples of which each sensor's packets are lost (NaN) by chance, each by itself.

    `sensors` counts the channels of each, in their order.
    """
    random = np.random.default_rng((seed, round(1000 * share)))
    lost = random.random((*samples.shape[:-1], len(sensors))) < share
    return np.where(np.repeat(lost, sensors, axis=-1), np.nan, samples)


def at(figure: str, share: float) -> str:
    """Return the key of a figure where so many packets are lost."""
    return f"{figure}_{100 * share:.0f}_percent_lost"
