"""The recipe for heel strikes and toe offs of one foot: IMUs on both feet and at the low back, 100 Hz.

It is about a moment `DELAY` samples before the newest one, at which the foot may have struck or left the
ground. One recipe
serves both feet: for the right one the body is mirrored.
"""

from typing import Final

import numpy as np

from ml.features.blocks import bins
from ml.features.gait_phase import mirrored
from ml.features.gait_status import CHANNELS, RATE_HZ
from ml.features.gaps import mended
from ml.features.recipe import Features, Recipe
from ml.features.signals import length
from ml.features.windows import Samples

LOOK_BACK: Final = 120
DELAY: Final = 15  # samples: what follows an event tells it from others


def _compute(windows: Samples) -> Features:
    trunk, _, foot, spin, other, other_spin = np.split(mended(windows), 6, axis=1)
    this = np.stack([spin[:, 1], foot[:, 0], foot[:, 2], length(spin), length(foot)], axis=1)
    that = np.stack([other_spin[:, 1], length(other_spin), length(other)], axis=1)
    columns = [
        bins(this, 2, 24),
        bins(this[:, :1], 1, 44),
        bins(this, 8, 14),
        bins(that, 4, 12),
        bins(that, 10, 12),
        bins(length(trunk)[:, None], 4, 12),
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def _compute_right(windows: Samples) -> Features:
    return _compute(mirrored(windows))


LEFT_EVENTS: Final = Recipe("gait_events_left", RATE_HZ, LOOK_BACK, CHANNELS, _compute)
RIGHT_EVENTS: Final = Recipe("gait_events_right", RATE_HZ, LOOK_BACK, CHANNELS, _compute_right)
