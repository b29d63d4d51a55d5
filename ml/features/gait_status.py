"""The recipe for standing, walking and turning: an IMU at the low back and one on each foot, 100 Hz.

Feet count without left and right, turns without their direction: a new wearer's other foot is no news.
"""

from typing import Final

import numpy as np

from ml.features.blocks import bins, flat, moments, since
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
    acceleration, spin = by_part(mended(windows))
    vertical = up(acceleration)
    yaw = along(spin, vertical)
    heading = headed(yaw, 100)
    motion = _motion(acceleration, spin, along(acceleration[:, 0], vertical[:, 0]), yaw[:, 0])
    columns = [
        bins(heading, 10, 20),
        _turned(heading),
        bins(np.log(SOFTEN + motion[:, [1, 2, 4, 5, 6, 7]]), 10, 20),
        moments(motion, *LENGTHS),
        _turning(heading),
        _rest(length(spin[:, 1:])),
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def by_part(windows: Samples) -> tuple[Samples, Samples]:
    """(n, channels, samples) → acceleration and angular velocity of trunk and feet, (n, 3, 3, samples) each.

    In memory the windows of a channel lie together: what is computed of it is one long loop.
    """
    channels = np.ascontiguousarray(windows.swapaxes(0, 1))
    parts = channels.reshape(3, 2, 3, *channels.shape[1:])
    return np.moveaxis(parts[:, 0], 2, 0), np.moveaxis(parts[:, 1], 2, 0)


def headed(yaw: Samples, newest: int) -> Samples:
    """Yaw rates (n, 2, samples) of the trunk and of both feet together.

    They are positive the way that the trunk turned in the `newest` samples.
    """
    trunk = yaw[:, 0]
    way = np.where(trunk[:, -newest:].sum(axis=1) < 0, -1.0, 1.0)
    return (np.stack([trunk, yaw[:, 1] + yaw[:, 2]]) * way[:, None]).swapaxes(0, 1)


def _motion(acceleration: Samples, spin: Samples, lift: Samples, yaw: Samples) -> Samples:
    """Return the amount of motion, in any direction: (n, 10, samples). `lift` and `yaw` are the trunk's."""
    weight, rate = length(acceleration), length(spin)
    left, right = rate[:, 1], rate[:, 2]
    jolt = np.abs(weight[:, 1:] - GRAVITY)
    signals = (
        lift - GRAVITY,
        across(acceleration[:, 0], lift),
        across(spin[:, 0], yaw),
        rate[:, 0],
        left + right,
        np.maximum(left, right),
        np.minimum(left, right),
        jolt[:, 0] + jolt[:, 1],
        np.abs(jolt[:, 0] - jolt[:, 1]),
        weight[:, 0],
    )
    return np.stack(signals).swapaxes(0, 1)


def _turned(heading: Samples) -> Samples:
    """By how much it has turned since …, and within the last seconds, rad."""
    since_then = np.cumsum(heading[:, :, ::-1], axis=-1)[:, :, [samples - 1 for samples in TURNED]]
    swing = np.cumsum(heading[:, 0], axis=-1)
    recent = np.cumsum(heading[:, 0, -100:], axis=-1)
    ranges = [np.ptp(swing, axis=-1), np.ptp(recent, axis=-1)]
    return np.concatenate([flat(since_then), np.stack(ranges, axis=1)], axis=1) / RATE_HZ


def _turning(heading: Samples) -> Samples:
    """Return how unsteadily and how fast, at most, it turned over every length, whichever way."""
    found = moments(heading, *LENGTHS).reshape(len(heading), len(LENGTHS), 4, -1)
    _, spread, most, least = np.moveaxis(found, 2, 0)
    return flat(np.stack([spread, np.maximum(np.abs(most), np.abs(least))], axis=2))


def _rest(feet: Samples) -> Samples:
    """(n, 2, samples), how fast they turn → how long the one that moved last, and the other, have rested."""
    moves = feet > np.array(STILL)[:, None, None, None]
    rested = since(moves.reshape(-1, feet.shape[-1])).reshape(len(STILL), -1, 2)
    return np.concatenate([rested.max(axis=-1), rested.min(axis=-1)]).T


GAIT_STATUS: Final = Recipe("gait_status", RATE_HZ, LOOK_BACK, CHANNELS, _compute)
