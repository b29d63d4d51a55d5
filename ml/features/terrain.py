"""The recipe for the ground under a hip exoskeleton: both hips' encoders and an IMU on the back, 50 Hz.

It looks back 0.2 s and never at the yaw, which tells where somebody walked and not on what.
"""

from typing import Final

import numpy as np

from ml.features.blocks import flat, moments
from ml.features.gait_status import QUANTITIES
from ml.features.gaps import mended
from ml.features.recipe import Features, Recipe
from ml.features.signals import length
from ml.features.windows import Samples

RATE_HZ: Final = 50
LOOK_BACK: Final = 11
HIP_RATE: Final = 0.2  # s; hip velocity times this is of the size of a hip angle: one over a stride's rad/s
CHANNELS: Final = (
    *(f"{side}_hip.{quantity}" for quantity in ("position", "velocity") for side in ("left", "right")),
    *(f"trunk.{quantity}" for quantity in QUANTITIES),
    "trunk.tilt_forward",
    "trunk.tilt_side",
)


def _compute(windows: Samples) -> Features:
    windows = mended(windows)
    both = _both_legs(windows)
    columns = [
        moments(windows, LOOK_BACK),
        windows[..., -1] - windows[..., 0],
        windows[..., -1],
        np.abs(np.diff(windows, axis=-1)).mean(axis=-1),
        moments(both, LOOK_BACK),
        both[..., -1],
        flat(_phase(windows)),
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def _both_legs(windows: Samples) -> Samples:
    """Return what the two hips do together and against each other, and how strongly the back moves."""
    left, right, left_rate, right_rate = (windows[:, channel] for channel in range(4))
    signals = (
        left + right,
        left - right,
        left_rate + right_rate,
        left_rate - right_rate,
        np.maximum(left, right),
        np.minimum(left, right),
        length(windows[:, 4:7]),
        length(windows[:, 7:10]),
        left * right,
        left_rate * right_rate,
    )
    return np.stack(signals, axis=1)


def _phase(windows: Samples) -> Samples:
    """Where in the stride the hips are, on the circle of their difference and its rate."""
    left, right, left_rate, right_rate = (windows[:, channel] for channel in range(4))
    phase = np.arctan2(HIP_RATE * (left_rate - right_rate), left - right)
    return np.stack([np.cos(phase), np.sin(phase)], axis=1)


TERRAIN: Final = Recipe("terrain", RATE_HZ, LOOK_BACK, CHANNELS, _compute)
