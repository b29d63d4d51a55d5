"""The recipe for the gait phase of one foot: an IMU at the low back and one on each foot, 100 Hz.

One recipe serves both feet: for the right one the body is mirrored, so that what is learned from either foot
holds for both.
"""

from typing import Final

import numpy as np

from ml.features.blocks import bins, falls
from ml.features.gait_status import CHANNELS, LOOK_BACK, RATE_HZ
from ml.features.gaps import mended
from ml.features.recipe import Features, Recipe
from ml.features.signals import GRAVITY, along, length, up
from ml.features.windows import Samples

SWAPPED: Final = [*range(6), *range(12, 18), *range(6, 12)]  # trunk, right foot, left foot
# Seen in a mirror: what points left points right, and what turns about x or z turns the other way.
SIGNS: Final = np.tile([1.0, -1.0, 1.0, -1.0, 1.0, -1.0], 3)[:, None]
SWING: Final = 1.0  # rad/s of pitch, above which a foot swings forward; it falls below at heel strike
PUSH_OFF: Final = -1.5  # rad/s, below which the heel rises
FLAT: Final = 0.3  # rad/s, below which a foot turns no more
USUAL_STRIDE: Final = 115.0  # samples; where no stride has been seen yet


def mirrored(windows: Samples) -> Samples:
    """Return the same walk seen in a mirror: the right foot's channels where the left one's were."""
    swapped: Samples = windows[:, SWAPPED] * SIGNS
    return swapped


def _compute(windows: Samples) -> Features:
    trunk, spin, foot, foot_spin, other, other_spin = np.split(mended(windows), 6, axis=1)
    vertical = up(trunk)
    lift, yaw = along(trunk, vertical) - GRAVITY, along(spin, vertical)
    this = np.stack([foot_spin[:, 1], foot[:, 0], foot[:, 2], length(foot_spin)], axis=1)
    that = np.stack([other_spin[:, 1], other[:, 0], other[:, 2]], axis=1)
    forward = trunk[:, 2] - trunk[:, 2].mean(axis=-1, keepdims=True)
    body = np.stack([lift, forward, trunk[:, 1], spin[:, 0], spin[:, 1], yaw], axis=1)
    columns = [
        bins(this, 2, 25),
        bins(this[:, :1], 5, 40),
        bins(this[:, 1:], 8, 20),
        bins(that, 4, 12),
        bins(that[:, :1], 5, 40),
        bins(that[:, 1:], 10, 15),
        bins(body, 5, 24),
        timing(foot_spin[:, 1], other_spin[:, 1]),
        vigour(foot_spin[:, 1], other_spin[:, 1]),
        yaw[:, -100:].mean(axis=-1, keepdims=True),
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def timing(this: Samples, other: Samples) -> Samples:
    """When each foot last struck, pushed off and lay flat: in samples and in strides; and their lengths."""
    events = [_events(pitch_rate) for pitch_rate in (this, other)]
    ago = np.concatenate(events, axis=1)
    strides = np.stack([_between(one, at) for one in events for at in (0, 1, 3)], axis=1)
    seen = (strides > 0).sum(axis=1)
    stride = np.where(seen > 0, strides.sum(axis=1) / np.maximum(seen, 1), USUAL_STRIDE)[:, None]
    return np.concatenate([ago, strides, stride, ago / stride], axis=1)


def _events(pitch_rate: Samples) -> Samples:
    """Return the samples since the last three heel strikes, three push-offs' ends, and rest on the ground."""
    smooth = (pitch_rate[:, 2:] + pitch_rate[:, 1:-1] + pitch_rate[:, :-2]) / 3.0
    return np.concatenate(
        [falls(smooth > SWING, 3), falls(smooth < PUSH_OFF, 3), falls(smooth < FLAT, 1)], axis=1
    )


def _between(events: Samples, at: int) -> Samples:
    """From an event to the same one before it, in samples; 0 where that is not seen."""
    newer, older = events[:, at], events[:, at + 1]
    return np.where(older < LOOK_BACK - 2, older - newer, 0.0)


def vigour(this: Samples, other: Samples) -> Samples:
    columns = [pitch[:, -samples:].std(axis=-1) for samples in (100, LOOK_BACK) for pitch in (this, other)]
    return np.stack(columns, axis=1)


def _compute_right(windows: Samples) -> Features:
    return _compute(mirrored(windows))


LEFT_PHASE: Final = Recipe("gait_phase_left", RATE_HZ, LOOK_BACK, CHANNELS, _compute)
RIGHT_PHASE: Final = Recipe("gait_phase_right", RATE_HZ, LOOK_BACK, CHANNELS, _compute_right)
