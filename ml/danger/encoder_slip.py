"""(j) Encoder slip: an angle that drifts away from the integral of its velocity.

Over whole strides the integral of the velocity returns to its start, however coarsely it was sampled; what
remains is the encoder's.
"""

from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.observation import JOINTS, Observation, or_zero, readable_name

FORGETS_S: Final = 6.0  # time constant of the drift's decay


class EncoderSlip:
    """Drift of each angle (rad); a gap in the rows adds nothing."""

    name = "creep"
    keys = JOINTS
    least = np.full(6, 0.004)  # rad
    needs = "position and velocity of a joint"

    def __init__(self) -> None:
        self._before = np.full((2, 6), np.nan)
        self._crept = np.zeros(6)

    def measure(self, now: Observation, *, learn: bool) -> Floats:  # noqa: ARG002 - it has nothing to learn
        position, velocity = now.joint[:2]
        moved = position - self._before[0]
        apart = moved - 0.5 * now.step_s * (velocity + self._before[1])
        self._before = now.joint[:2].copy()
        if now.step_s == 0.0:
            return np.full(6, np.nan)
        self._crept += or_zero(apart) - now.step_s / FORGETS_S * self._crept
        return np.where(np.isfinite(apart), np.abs(self._crept), np.nan)

    def words(self, key: str) -> str:
        joint = readable_name(key)
        return f"{joint}: the angle creeps away from what its velocity adds up to: the encoder slips"
