"""Blocks of features, one for each group of sensors and task: windows at 50 Hz → columns.

For activity a robot's left and right count without their names; for the phase they are everything.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from ml.features.blocks import bins, flat, moments
from ml.features.falling import BEFORE, FALLING
from ml.features.signals import length
from ml.features.windows import Samples

RATE_HZ: Final = 50
LENGTHS: Final = (10, 25, 50, 100)  # samples: 0.2, 0.5, 1 and 2 s
SHORT_LENGTHS: Final = (5, 10, 25, 75)  # for what happens fast
TURNED: Final = (25, 50, 75, 100)  # samples over which a heading is compared
SPAN: Final = 2  # samples between which a rate is taken: 40 ms
KILO: Final = 1000.0  # forces in kN are of the size of angles in rad

Block = Callable[[Samples], Samples]


def joints_activity(pair: Samples) -> Samples:
    """Left and right joint (rad): how far, how unlike, how fast, over every length; and their curves."""
    signals = _unnamed(pair)
    ends = np.stack([pair.max(axis=1), pair.min(axis=1)], axis=1)
    return np.concatenate(
        [moments(signals, *LENGTHS), bins(ends, 10, 10), flat(ends[..., -1:])],
        axis=1,
    )


def feet_activity(pair: Samples) -> Samples:
    """Both insoles (N): load and how it is shared."""
    return joints_activity(pair / KILO)


def trunk_activity(trunk: Samples) -> Samples:
    """Acceleration, angular velocity, tilt: how it moves, how far it has turned, how it leans."""
    signals = trunk.copy()
    sideways = [1, 3, 5, 7]  # acceleration to the left, roll and yaw rate, tilt to the side: whichever way
    signals[:, sideways] = np.abs(trunk[:, sideways])
    columns = [moments(signals, *LENGTHS), bins(signals, 10, 10), _turned(trunk[:, 5])]
    return np.concatenate(columns, axis=1)


def joints_phase(pair: Samples) -> Samples:
    """Both curves, finest in the last half second."""
    return np.concatenate([bins(pair, 2, 12), bins(pair, 5, 20), flat(_rate(pair)[..., -1:])], axis=1)


def feet_phase(pair: Samples) -> Samples:
    return joints_phase(pair / KILO)


def trunk_phase(trunk: Samples) -> Samples:
    """Return the channels that swing with the stride: acceleration, roll and yaw."""
    return bins(trunk[:, [0, 1, 2, 3, 5, 7]], 5, 20)


def trunk_falling(trunk: Samples) -> Samples:
    """How light the body is, how fast it turns and tips over, from which posture; a usual lean is no news."""
    leaning = trunk[:, 6:] - trunk[:, 6:, :BEFORE].mean(axis=-1, keepdims=True)
    leaning[:, 1] = np.abs(leaning[:, 1])
    tilts = moments(leaning, *SHORT_LENGTHS)
    return np.concatenate([FALLING.compute(trunk[:, :6]), tilts, bins(leaning, 5, 10)], axis=1)


def _unnamed(pair: Samples) -> Samples:
    """Mean, difference and speed of two sides, whichever is which: (n, 3, samples)."""
    both = pair.mean(axis=1)
    gap = np.abs(pair[:, 0] - pair[:, 1])
    speed = np.zeros_like(both)
    speed[:, SPAN:] = length(_rate(pair))
    return np.stack([both, gap, speed], axis=1)


def _rate(pair: Samples) -> Samples:
    return (pair[..., SPAN:] - pair[..., :-SPAN]) * (RATE_HZ / SPAN)


def _turned(yaw_rate: Samples) -> Samples:
    """By how much it has turned within the last …, rad, whichever way."""
    angle = np.cumsum(yaw_rate[:, ::-1], axis=1) / RATE_HZ
    return np.abs(angle[:, [samples - 1 for samples in TURNED]])


_JOINTS: Final = ("hips", "knees", "ankles")
BLOCKS: Final[Mapping[str, Mapping[str, Block]]] = MappingProxyType(
    {
        "activity": {
            **dict.fromkeys(_JOINTS, joints_activity),
            "feet": feet_activity,
            "trunk": trunk_activity,
        },
        "gait_phase": {**dict.fromkeys(_JOINTS, joints_phase), "feet": feet_phase, "trunk": trunk_phase},
        "falling": {"trunk": trunk_falling},  # legs differ more between people than falls do
    }
)
