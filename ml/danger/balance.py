"""(e) Balance: where the trunk is going, by its tilt and rate (extrapolated centre of mass, Hof 2005)."""

import math
from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.observation import Observation

OMEGA: Final = math.sqrt(9.81 / 1.0)  # 1/s, of a body whose mass is a metre above the ground
FOLLOWS: Final = 0.012  # of a sample at 25 Hz: what the trunk's lean has been for three seconds
TRUSTS: Final = 0.04  # of the accelerometer in each sample, where no tilt is told
GRAVITY: Final = 9.81
SMOOTH: Final = 0.5


class Balance:
    """The extrapolated tilt, tilt + rate / ω₀, forward, backward and aside; and how light the body is."""

    name = "balance"
    keys = ("forward", "backward", "left", "right", "falls free")
    least = np.array([0.03, 0.03, 0.03, 0.03, 0.05])  # rad, and shares of gravity
    needs = "the trunk's acceleration and angular velocity"

    def __init__(self) -> None:
        self._tilt = np.full(2, np.nan)
        self._lean = np.full(2, np.nan)
        self._light = 0.0

    def measure(self, now: Observation, *, learn: bool) -> Floats:  # noqa: ARG002 - it has nothing to learn
        acceleration, rate, told = now.trunk[:3], now.trunk[3:6], now.trunk[6:8]
        if not np.isfinite(now.trunk[:6]).all():
            return np.full(5, np.nan)
        forward, right = rate[1], rate[0]  # about y (left): forward; about x: the right side down
        felt = np.array(
            [math.atan2(-acceleration[0], acceleration[2]), math.atan2(acceleration[1], acceleration[2])]
        )
        if np.isfinite(told).all():
            self._tilt = np.array([told[0], -told[1]])
        elif np.isfinite(self._tilt).all():
            self._tilt = self._tilt + now.step_s * np.array([forward, right])
            self._tilt += TRUSTS * (felt - self._tilt)
        else:
            self._tilt = felt
        if not np.isfinite(self._lean).all():
            self._lean = self._tilt
        self._lean = self._lean + FOLLOWS * (self._tilt - self._lean)
        ahead, aside = (self._tilt - self._lean) + np.array([forward, right]) / OMEGA
        light = max(1.0 - float(np.linalg.norm(acceleration)) / GRAVITY, 0.0)
        self._light += SMOOTH * (light - self._light)
        found: Floats = np.maximum(np.array([ahead, -ahead, -aside, aside, self._light]), 0.0)
        return found

    def words(self, key: str) -> str:
        if key == "falls free":
            return "the body is lighter than it ever is"
        return f"the trunk is going over, {key}"
