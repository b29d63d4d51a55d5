"""The recipe for the ground under a hip exoskeleton: both hips' encoders and an IMU on the back, 50 Hz.

It looks back 0.2 s and never at the yaw, which tells where somebody walked and not on what. A step of the
right leg is taken for the left one's in a mirror.
"""

from typing import Final

import numpy as np

from ml.features.blocks import flat, moments
from ml.features.gait_status import QUANTITIES
from ml.features.gaps import mended
from ml.features.recipe import Features, Recipe
from ml.features.windows import Samples

RATE_HZ: Final = 50
LOOK_BACK: Final = 11
AHEAD_S: Final = 0.1  # the leading leg is the one that will be in front then
SHAPE: Final = (0, 5, 10)  # samples of a window: its beginning, middle and end
CHANNELS: Final = (
    *(f"{side}_hip.{quantity}" for quantity in ("position", "velocity") for side in ("left", "right")),
    *(f"trunk.{quantity}" for quantity in QUANTITIES),
    "trunk.tilt_forward",
    "trunk.tilt_side",
)
# A mirror across this IMU's x, from side to side: it turns what goes that way, and rotations about y and z.
SWAPPED: Final = (1, 0, 3, 2, *range(4, 12))  # where each channel comes from
SIGNS: Final = np.array([1.0, 1, 1, 1, -1, 1, 1, 1, -1, -1, 1, -1])[:, None]


def _compute(windows: Samples) -> Features:
    windows = led_by_the_left(mended(windows))
    columns = [
        moments(windows, LOOK_BACK),
        np.abs(np.diff(windows, axis=-1)).mean(axis=-1),
        flat(windows[..., SHAPE]),
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def mirrored(windows: Samples) -> Samples:
    """Return the windows with left and right exchanged."""
    swapped: Samples = windows[:, SWAPPED] * SIGNS
    return swapped


def led_by_the_left(windows: Samples) -> Samples:
    """Mirror the windows in which the right leg is in front or about to be: half as many kinds of steps."""
    left, right, left_rate, right_rate = (windows[:, channel, -1] for channel in range(4))
    right_leads = left - right + AHEAD_S * (left_rate - right_rate) < 0.0
    led: Samples = np.where(right_leads[:, None, None], mirrored(windows), windows)
    return led


TERRAIN: Final = Recipe("terrain", RATE_HZ, LOOK_BACK, CHANNELS, _compute)
