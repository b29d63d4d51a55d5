"""(g) Sensors that contradict each other: angle against velocity, tilt against rate and gravity."""

import math
from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.observation import JOINTS, Observation, or_zero, readable_name

SLOW: Final = 0.1  # of the newest sample
HOLDS: Final = 0.94  # share of a jump that is left a sample later


class SensorConsistency:
    """Each number is the difference between two sensors of one quantity."""

    name = "agreement"
    keys = (*JOINTS, "tilt and rate", "tilt and gravity")
    least = np.array([0.002] * 6 + [0.01, 0.02])  # rad
    needs = "position and velocity of a joint, or the trunk's IMU"

    def __init__(self) -> None:
        self._before = np.full(16, np.nan)  # positions, velocities, tilts and their rates
        self._jump = np.zeros(6)
        self._turned = 0.0
        self._apart = math.nan

    def measure(self, now: Observation, *, learn: bool) -> Floats:  # noqa: ARG002 - it has nothing to learn
        position, velocity = now.joint[:2]
        tilts, rates = now.trunk[6:8], np.array([now.trunk[4], -now.trunk[3]])
        values = np.concatenate([position, velocity, tilts, rates])
        step = values - self._before
        middle = 0.5 * (values + self._before)
        self._before = values
        if now.step_s == 0.0:
            return np.full(8, np.nan)
        jump = np.abs(step[:6] - now.step_s * middle[6:12])
        self._jump = np.maximum(HOLDS * self._jump, or_zero(jump))
        turned = abs(float(step[12]) - now.step_s * float(middle[14]))
        self._turned = max(HOLDS * self._turned, 0.0 if math.isnan(turned) else turned)
        return np.concatenate(
            [
                np.where(np.isfinite(jump), self._jump, np.nan),
                [math.nan if math.isnan(turned) else self._turned, self._gravity(now)],
            ]
        )

    def _gravity(self, now: Observation) -> float:
        """Return the difference of the reported tilt from gravity's, smoothed over a second."""
        apart = math.atan2(-now.trunk[0], now.trunk[2]) - float(now.trunk[6])
        if math.isnan(apart):
            return math.nan
        self._apart = apart if math.isnan(self._apart) else self._apart + SLOW * (apart - self._apart)
        return abs(self._apart)

    def words(self, key: str) -> str:
        if key in JOINTS:
            return f"{readable_name(key)}: the angle jumps, and the velocity does not show it"
        return f"the trunk's {key} contradict each other"
