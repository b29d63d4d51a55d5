"""The recipe for standing, walking and turning: an IMU at the low back and one on each foot, 100 Hz.

Feet count without left and right, turns without their direction: a new wearer's other foot is no news.
"""

from typing import Final

import numpy as np

from ml.features.blocks import bins, deviation, flat, moments, since
from ml.features.gaps import mended
from ml.features.recipe import Features, Recipe
from ml.features.signals import GRAVITY, across, along, length, up
from ml.features.windows import Samples

RATE_HZ: Final = 100
LOOK_BACK: Final = 200
QUANTITIES: Final = tuple(
    f"{quantity}_{axis}" for quantity in ("acceleration", "angular_velocity") for axis in "xyz"
)
CHANNELS: Final = tuple(
    f"{part}.{quantity}" for part in ("trunk", "left_foot", "right_foot") for quantity in QUANTITIES
)
LENGTHS: Final = (20, 50, 100, 200)  # samples: 0.2, 0.5, 1 and 2 s
TURNED: Final = (20, 40, 60, 80, 100, 125, 150, 200)  # samples over which a heading is compared
STILL: Final = (0.3, 1.0, 2.0)  # rad/s, below which a foot rests
SOFTEN: Final = 0.05  # added before a logarithm: the noise of a sensor at rest


def _compute(windows: Samples) -> Features:
    trunk, spin, left, left_spin, right, right_spin = np.split(mended(windows), 6, axis=1)
    vertical = up(trunk)
    lift, yaw = along(trunk, vertical), along(spin, vertical)
    motion = _motion(trunk, spin, lift, yaw, (left, right), (left_spin, right_spin))
    heading = _heading(yaw, along(left_spin, up(left)) + along(right_spin, up(right)))
    shape = np.log(SOFTEN + motion[:, [1, 2, 4, 5, 6, 7]])
    columns = [
        bins(heading, 10, 20),
        _turned(heading),
        bins(shape, 10, 20),
        *(moments(motion, samples) for samples in LENGTHS),
        *(_turning(heading[..., -samples:]) for samples in LENGTHS),
        _rest(length(left_spin), length(right_spin)),
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def _motion(
    trunk: Samples,
    spin: Samples,
    lift: Samples,
    yaw: Samples,
    feet: tuple[Samples, Samples],
    feet_spin: tuple[Samples, Samples],
) -> Samples:
    """Return the amount of motion, in any direction: (n, 10, samples)."""
    left, right = (length(one) for one in feet_spin)
    left_jolt, right_jolt = (np.abs(length(one) - GRAVITY) for one in feet)
    signals = (
        lift - GRAVITY,
        across(trunk, lift),
        across(spin, yaw),
        length(spin),
        left + right,
        np.maximum(left, right),
        np.minimum(left, right),
        left_jolt + right_jolt,
        np.abs(left_jolt - right_jolt),
        length(trunk),
    )
    return np.stack(signals, axis=1)


def _heading(trunk: Samples, feet: Samples) -> Samples:
    """Yaw rates of trunk and feet (n, 2, samples), positive the way that the trunk turned last second."""
    way = np.where(trunk[:, -100:].sum(axis=1) < 0, -1.0, 1.0)
    return np.stack([trunk, feet], axis=1) * way[:, None, None]


def _turned(heading: Samples) -> Samples:
    """By how much it has turned since …, and within the last seconds, rad."""
    since_then = np.cumsum(heading[:, :, ::-1], axis=-1)[:, :, [samples - 1 for samples in TURNED]]
    swing = np.cumsum(heading[:, 0], axis=-1)
    recent = np.cumsum(heading[:, 0, -100:], axis=-1)
    ranges = [np.ptp(swing, axis=-1), np.ptp(recent, axis=-1)]
    return np.concatenate([flat(since_then), np.stack(ranges, axis=1)], axis=1) / RATE_HZ


def _turning(heading: Samples) -> Samples:
    spread = deviation(heading, heading.mean(axis=-1, keepdims=True))
    return np.concatenate([spread, np.abs(heading).max(axis=-1)], axis=1)


def _rest(left: Samples, right: Samples) -> Samples:
    """Return the rest time of the foot that moved last, and of the other one."""
    feet = [(since(left > still), since(right > still)) for still in STILL]
    columns = [ordered(one, other) for ordered in (np.maximum, np.minimum) for one, other in feet]
    return np.stack(columns, axis=1)


GAIT_STATUS: Final = Recipe("gait_status", RATE_HZ, LOOK_BACK, CHANNELS, _compute)
