"""The recipe for standing, walking and turning in context: `GAIT_STATUS`, and six seconds at 20 Hz.

A pause of two seconds is the end of a walk, or a breath after a turn: the newest two seconds cannot tell.
"""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.features.blocks import bins, by_channel, flat
from ml.features.gait_status import CHANNELS, GAIT_STATUS, RATE_HZ, SOFTEN
from ml.features.gaps import mended
from ml.features.recipe import Features, Recipe
from ml.features.signals import GRAVITY, along, length, up
from ml.features.windows import Samples

LOOK_BACK: Final = 600
COARSE: Final = 5  # one sample of so many is taken: 20 Hz
STRETCH: Final = 10  # of these, of which the mean is taken: 0.5 s
SECOND: Final = 20  # of these
TURNED: Final = range(50, LOOK_BACK // COARSE + 1, 10)  # of these, over which a heading is compared


def _compute(windows: Samples) -> Features:
    filled = mended(windows)
    coarse = by_channel(filled[..., ::COARSE])
    trunk, spin, left, left_spin, right, right_spin = np.split(coarse, 6, axis=1)
    yaw = along(spin, up(trunk))
    heading = _heading(yaw, along(left_spin, up(left)) + along(right_spin, up(right)))
    feet = length(left_spin), length(right_spin)
    signals = (length(spin), sum(feet), np.minimum(*feet), np.abs(length(trunk) - GRAVITY))
    columns: list[npt.NDArray[Any]] = [
        GAIT_STATUS.compute(filled[..., -GAIT_STATUS.look_back :]),
        bins(heading, STRETCH, coarse.shape[-1] // STRETCH),
        bins(np.log(SOFTEN + np.stack(signals)).swapaxes(0, 1), STRETCH, coarse.shape[-1] // STRETCH),
        _turned(heading),
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def _heading(trunk: Samples, feet: Samples) -> Samples:
    """Yaw rates of trunk and feet (n, 2, samples), positive the way that the trunk turned last second."""
    way = np.where(trunk[:, -SECOND:].sum(axis=1) < 0, -1.0, 1.0)
    return (np.stack([trunk, feet]) * way[:, None]).swapaxes(0, 1)


def _turned(heading: Samples) -> Samples:
    """By how much it has turned since …, and within it all, rad."""
    since_then = np.cumsum(heading[..., ::-1], axis=-1)
    swing = np.ptp(np.cumsum(heading[:, 0], axis=-1), axis=-1)
    return np.concatenate([flat(since_then[..., [at - 1 for at in TURNED]]), swing[:, None]], axis=1) / SECOND


GAIT_CONTEXT: Final = Recipe("gait_context", RATE_HZ, LOOK_BACK, CHANNELS, _compute)
