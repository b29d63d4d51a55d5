"""(g) Sensors that contradict each other: angle and velocity, tilt and rate, insoles and IMU."""

import math
from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.now import JOINTS, Now, spoken

SLOW: Final = 0.1  # of the newest sample
MASS_LEARNS: Final = 0.006
HOLDS: Final = 0.94  # of a jump is left a sample later


class Agreement:
    """Each number is what two sensors say of one thing, apart."""

    name = "agreement"
    keys = (*JOINTS, "tilt and rate", "tilt and gravity", "insoles and trunk")
    least = np.array([0.002] * 6 + [0.01, 0.02, 0.04])  # rad, and a share of the weight
    needs = "position and velocity of a joint, or the trunk's IMU and the insoles"

    def __init__(self) -> None:
        self._before = np.full(16, np.nan)  # positions, velocities, tilts and their rates
        self._jump = np.zeros(6)
        self._turned = 0.0
        self._apart = math.nan
        self._felt = math.nan
        self._mass = math.nan

    def measure(self, now: Now, *, learn: bool) -> Floats:
        position, velocity = now.joint[:2]
        tilts, rates = now.trunk[6:8], np.array([now.trunk[4], -now.trunk[3]])
        values = np.concatenate([position, velocity, tilts, rates])
        step = values - self._before
        middle = 0.5 * (values + self._before)
        self._before = values
        if now.step_s == 0.0:
            return np.full(9, np.nan)
        jump = np.abs(step[:6] - now.step_s * middle[6:12])
        self._jump = np.maximum(HOLDS * self._jump, np.nan_to_num(jump))
        turned = abs(float(step[12]) - now.step_s * float(middle[14]))
        self._turned = max(HOLDS * self._turned, 0.0 if math.isnan(turned) else turned)
        return np.concatenate(
            [
                np.where(np.isfinite(jump), self._jump, np.nan),
                [math.nan if math.isnan(turned) else self._turned, self._gravity(now)],
                [self._weight(now, learn=learn)],
            ]
        )

    def _gravity(self, now: Now) -> float:
        """The tilt that is told against the one that gravity shows, over a second."""
        apart = math.atan2(-now.trunk[0], now.trunk[2]) - float(now.trunk[6])
        if math.isnan(apart):
            return math.nan
        self._apart = apart if math.isnan(self._apart) else self._apart + SLOW * (apart - self._apart)
        return abs(self._apart)

    def _weight(self, now: Now, *, learn: bool) -> float:
        """What the insoles bear against the acceleration that the trunk feels, as a share of the mass."""
        felt = float(np.linalg.norm(now.trunk[:3]))
        force = float(now.foot[0].sum())
        if math.isnan(felt) or math.isnan(force):
            return math.nan
        mass = force / max(felt, 1.0)
        self._felt = mass if math.isnan(self._felt) else self._felt + SLOW * (mass - self._felt)
        if learn:
            known = not math.isnan(self._mass)
            self._mass = self._mass + MASS_LEARNS * (mass - self._mass) if known else mass
        return abs(self._felt / self._mass - 1.0) if self._mass > 0.0 else math.nan

    def words(self, key: str) -> str:
        if key in JOINTS:
            return f"{spoken(key)}: the angle jumps, and the velocity does not show it"
        if key == "insoles and trunk":
            return "the insoles bear another weight than the trunk feels"
        return f"the trunk's {key} contradict each other"
