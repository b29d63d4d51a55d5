"""Recipes by the angular velocity of both feet alone, 100 Hz: a foot's phase, and when it begins to move.

For recordings that tell no more. Of the three axes only the pitch is told apart, so that it does not matter
how else a sensor was turned on its foot. One recipe serves both feet: for the right one they are swapped.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from ml.features.blocks import bins
from ml.features.gait_phase import timing, vigour
from ml.features.gait_status import CHANNELS as EVERY
from ml.features.gait_status import LOOK_BACK, RATE_HZ
from ml.features.gaps import mended
from ml.features.recipe import Features, Recipe
from ml.features.signals import length
from ml.features.windows import Samples

CHANNELS: Final = tuple(name for name in EVERY if "_foot.angular_velocity_" in name)
EVENT_LOOK_BACK: Final = 120
EVENT_DELAY: Final = 15  # samples: what follows an event tells it from others


def _phase(left: Samples, right: Samples) -> Features:
    this, that = _told(left), _told(right)
    columns = [
        bins(this, 2, 25),
        bins(this[:, :1], 5, 40),
        bins(this[:, 1:], 8, 20),
        bins(that, 4, 12),
        bins(that[:, :1], 5, 40),
        bins(that[:, 1:], 10, 15),
        timing(left[:, 1], right[:, 1]),
        vigour(left[:, 1], right[:, 1]),
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def _events(left: Samples, right: Samples) -> Features:
    this, that = _told(left), _told(right)
    columns = [bins(this, 1, 44), bins(this, 8, 14), bins(that, 4, 12), bins(that, 10, 12)]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def _told(foot: Samples) -> Samples:
    """Return a foot's pitch rate, and how fast it turns at all."""
    return np.stack([foot[:, 1], length(foot)], axis=1)


def _of(compute: Callable[[Samples, Samples], Features], name: str, look_back: int) -> tuple[Recipe, Recipe]:
    """Return the recipe for the left foot and that for the right one."""

    def left(windows: Samples) -> Features:
        feet = mended(windows)
        return compute(feet[:, :3], feet[:, 3:])

    def right(windows: Samples) -> Features:
        feet = mended(windows)
        return compute(feet[:, 3:], feet[:, :3])

    return (
        Recipe(f"{name}_left", RATE_HZ, look_back, CHANNELS, left),
        Recipe(f"{name}_right", RATE_HZ, look_back, CHANNELS, right),
    )


PHASES: Final = _of(_phase, "foot_rates_phase", LOOK_BACK)
EVENTS: Final = _of(_events, "foot_rates_events", EVENT_LOOK_BACK)
