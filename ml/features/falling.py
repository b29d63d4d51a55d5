"""The recipe for a beginning fall: one IMU at the waist, 50 Hz.

What falling is: the body gets lighter, tips over and turns, from a posture that was upright.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from ml.features.blocks import deviation, flat
from ml.features.gait_status import QUANTITIES
from ml.features.gaps import mended
from ml.features.recipe import Features, Recipe
from ml.features.signals import GRAVITY, TINY, along, length
from ml.features.windows import Samples

RATE_HZ: Final = 50
LOOK_BACK: Final = 75
LENGTHS: Final = (5, 10, 15, 25, 50, 75)  # samples: 0.1 to 1.5 s
BEFORE: Final = 25  # samples at the window's beginning: the posture that a fall begins from
LIGHT, LIGHTER, HEAVY = 7.0, 5.0, 14.0  # m/s²: two degrees of falling, and a blow
STRETCH: Final = 5  # samples in which a rotation is taken as even
TILT_FROM: Final = 15  # samples into the window: the middle of its beginning
TIPPED: Final = (1, 2, 5)  # stretches over which the growing tilt is compared
PER_LENGTH: Final = 17  # columns for each of LENGTHS
NEXT, LAST = [1, 2, 0], [2, 0, 1]  # of x, y, z
MOVING: Final = 1.0  # m/s² of deviation, or rad/s


def _compute(windows: Samples) -> Features:
    windows = mended(windows)
    acceleration, spin = windows[:, :3], windows[:, 3:]
    weight, turning = length(acceleration), length(spin)
    before = acceleration[..., :BEFORE].mean(axis=-1)
    upright = _direction(before)
    by_length, newest = _by_length(acceleration, spin, np.stack([weight, turning], axis=1), upright)
    counts = (
        (weight[:, -25:] < LIGHT).sum(axis=1),
        (weight[:, -10:] < LIGHTER).sum(axis=1),
        (weight > HEAVY).sum(axis=1),
    )
    columns = [
        by_length,
        _tipping(acceleration, spin, upright),
        weight[:, -1:],
        turning[:, -1:],
        newest,
        before,
        np.stack(counts, axis=1),
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def _by_length(
    acceleration: Samples, spin: Samples, signals: Samples, upright: Samples
) -> tuple[Samples, Samples]:
    """PER_LENGTH columns over each of LENGTHS, (n, columns); and the mean acceleration over the first.

    `signals` (n, 2, samples): weight and turning. What takes many calls for few numbers is done for all
    lengths at once.
    """
    columns = np.empty((len(signals), len(LENGTHS), PER_LENGTH))
    posture, drift = (np.empty((len(signals), len(LENGTHS), 3)) for _ in range(2))
    jolts = np.abs(acceleration[..., 1:] - acceleration[..., :-1])
    for at, samples in enumerate(LENGTHS):
        newest = signals[..., -samples:]
        moments = columns[:, at, :8].reshape(len(signals), 2, 4)
        moments[..., 0] = newest.mean(axis=-1)
        moments[..., 1], moments[..., 2] = newest.min(axis=-1), newest.max(axis=-1)
        moments[..., 3] = deviation(newest, moments[..., :1])
        columns[:, at, :8] = moments.reshape(len(signals), 8)
        columns[:, at, 9] = np.ascontiguousarray(jolts[..., 1 - samples :]).mean(axis=(1, 2))
        posture[:, at] = acceleration[..., -samples:].mean(axis=-1)
        drift[:, at] = spin[..., -samples:].mean(axis=-1)
    speed = np.cumsum((signals[:, 0] - GRAVITY)[:, ::-1], axis=1) / RATE_HZ  # m/s gained upwards since …
    columns[..., 8] = speed[:, [samples - 1 for samples in LENGTHS]]
    overall = _direction(posture[:, -1:])
    columns[..., 10] = _long(posture)
    columns[..., 11] = _angle(_direction(posture), upright[:, None])
    columns[..., 12] = _angle(_direction(posture), overall)
    columns[..., 13:16] = np.abs(drift)
    columns[..., 16] = _long(drift)
    return flat(columns), posture[:, 0]


def _long(vectors: Samples) -> Samples:
    """(…, 3) → (…)."""
    lengths: Samples = np.sqrt((vectors * vectors).sum(axis=-1))
    return lengths


def _direction(vectors: Samples) -> Samples:
    return vectors / np.maximum(_long(vectors), TINY)[..., None]


def _angle(one: Samples, other: Samples) -> Samples:
    """Between unit vectors (…, 3), rad."""
    cosine = (one * other).sum(axis=-1)
    angle: Samples = np.arccos(np.minimum(np.maximum(cosine, -1.0), 1.0))
    return angle


def _tipping(acceleration: Samples, spin: Samples, upright: Samples) -> Samples:
    """Return the gyroscope's tilt since the window's start, its rate of growth, and the lift."""
    rates = spin[..., TILT_FROM:].reshape(*spin.shape[:2], -1, STRETCH).mean(axis=-1)
    verticals = _turned(upright, rates.transpose(0, 2, 1) * (-STRETCH / RATE_HZ))
    tilts = _angle(_direction(verticals), upright[:, None])
    grown = [tilts[:, -1] - tilts[:, -1 - stretches] for stretches in TIPPED]
    lift = along(acceleration[..., -1:], verticals[:, -1, :, None])
    return np.concatenate([tilts[:, -1:], np.stack(grown, axis=1), lift], axis=1)


def _turned(vector: Samples, rotations: Samples) -> Samples:
    """Return vectors (n, 3) after rotations (n, steps, 3) about an axis by its length, rad (Rodrigues)."""
    angle = _long(rotations)[..., None]
    axis = rotations / np.maximum(angle, TINY)
    next_axis, last_axis = axis[..., NEXT], axis[..., LAST]
    cosine, sine = np.cos(angle), np.sin(angle)
    rest = 1.0 - cosine
    turned = np.empty_like(axis)
    for at in range(axis.shape[1]):
        crossed = next_axis[:, at] * vector[:, LAST] - last_axis[:, at] * vector[:, NEXT]
        aligned = (axis[:, at] * vector).sum(axis=1)[:, None]
        vector = vector * cosine[:, at] + crossed * sine[:, at] + axis[:, at] * (aligned * rest[:, at])
        turned[:, at] = vector
    return turned


def moving(values: Features) -> npt.NDArray[np.bool_]:
    """Return the rows of features in which somebody moves: his weight changes, or his waist turns."""
    at = LENGTHS.index(25) * PER_LENGTH
    weight_deviation, mean_turning = values[:, at + 3], values[:, at + 4]
    return np.asarray((weight_deviation > MOVING) | (mean_turning > MOVING))


FALLING: Final = Recipe(
    "falling", RATE_HZ, LOOK_BACK, tuple(f"trunk.{quantity}" for quantity in QUANTITIES), _compute
)
