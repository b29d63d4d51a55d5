"""(j) An angle that creeps away from what its velocity adds up to: an encoder that slips, jump by jump.

Over whole strides the sum of velocities comes back to where it began, however coarsely it was sampled;
what does not come back is the encoder's.
"""

from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.now import JOINTS, Now, or_zero, spoken

FORGETS_S: Final = 6.0  # a time after which a third is left of what an angle has crept


class Creep:
    """How far each angle has crept (rad); a gap in the rows adds nothing."""

    name = "creep"
    keys = JOINTS
    least = np.full(6, 0.004)  # rad
    needs = "position and velocity of a joint"

    def __init__(self) -> None:
        self._before = np.full((2, 6), np.nan)
        self._crept = np.zeros(6)

    def measure(self, now: Now, *, learn: bool) -> Floats:  # noqa: ARG002 - it has nothing to learn
        position, velocity = now.joint[:2]
        moved = position - self._before[0]
        apart = moved - 0.5 * now.step_s * (velocity + self._before[1])
        self._before = now.joint[:2].copy()
        if now.step_s == 0.0:
            return np.full(6, np.nan)
        self._crept += or_zero(apart) - now.step_s / FORGETS_S * self._crept
        return np.where(np.isfinite(apart), np.abs(self._crept), np.nan)

    def words(self, key: str) -> str:
        return f"{spoken(key)}: the angle creeps away from what its velocity adds up to: the encoder slips"
