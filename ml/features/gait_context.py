"""The recipe for standing, walking and turning in context: `GAIT_STATUS`, and six seconds at 20 Hz.

A pause of two seconds is the end of a walk, or a breath after a turn: the newest two seconds cannot tell.
"""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.features.blocks import bins, flat
from ml.features.gait_status import CHANNELS, GAIT_STATUS, RATE_HZ, SOFTEN, by_part, headed
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
    # First, while little else is held: memory that is let go of at the end is not asked for anew next time.
    newest = GAIT_STATUS.compute(filled[..., -GAIT_STATUS.look_back :])
    acceleration, spin = by_part(filled[..., ::COARSE])
    vertical = up(acceleration)
    heading = headed(along(spin, vertical), SECOND)
    rate = length(spin)
    left, right = rate[:, 1], rate[:, 2]
    jolt = np.abs(length(acceleration[:, 0]) - GRAVITY)
    motion = np.stack([rate[:, 0], left + right, np.minimum(left, right), jolt]).swapaxes(0, 1)
    stretches = LOOK_BACK // COARSE // STRETCH
    columns: list[npt.NDArray[Any]] = [
        newest,
        bins(heading, STRETCH, stretches),
        bins(np.log(SOFTEN + motion), STRETCH, stretches),
        _turned(heading),
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def _turned(heading: Samples) -> Samples:
    """By how much it has turned since …, and within it all, rad."""
    since_then = np.cumsum(heading[..., ::-1], axis=-1)
    swing = np.ptp(np.cumsum(heading[:, 0], axis=-1), axis=-1)
    return np.concatenate([flat(since_then[..., [at - 1 for at in TURNED]]), swing[:, None]], axis=1) / SECOND


GAIT_CONTEXT: Final = Recipe("gait_context", RATE_HZ, LOOK_BACK, CHANNELS, _compute)
