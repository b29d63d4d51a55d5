"""The recipe for the gait phase of one foot by the angular velocity of both feet alone, 100 Hz.

For recordings that tell no more. Of the three axes only the pitch is told apart, so that it does not matter
how else a sensor was turned on its foot. One recipe serves both feet: for the right one they are swapped.
"""

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


def _told(foot: Samples) -> Samples:
    """Return a foot's pitch rate, and how fast it turns at all."""
    return np.stack([foot[:, 1], length(foot)], axis=1)


def _left(windows: Samples) -> Features:
    feet = mended(windows)
    return _phase(feet[:, :3], feet[:, 3:])


def _right(windows: Samples) -> Features:
    feet = mended(windows)
    return _phase(feet[:, 3:], feet[:, :3])


PHASES: Final = (
    Recipe("foot_rates_phase_left", RATE_HZ, LOOK_BACK, CHANNELS, _left),
    Recipe("foot_rates_phase_right", RATE_HZ, LOOK_BACK, CHANNELS, _right),
)
