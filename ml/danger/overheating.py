"""(h) Overheating: a motor's temperature, extrapolated at its present rate of rise."""

from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.observation import JOINTS, Observation, or_zero, readable_name

AHEAD_S: Final = 15.0  # horizon of the extrapolation
WARM_C: Final = 40.0  # lower temperatures count as this


class Overheating:
    """Extrapolated temperature of each motor; slow drift of the gait is compared in `strides`."""

    name = "drift"
    keys = tuple(f"{joint}.heat" for joint in JOINTS)
    least = np.full(6, 8.0)  # °C
    needs = "a motor's temperature"

    def __init__(self) -> None:
        self._warm = np.full(6, np.nan)
        self._rise = np.zeros(6)  # °C/s

    def measure(self, now: Observation, *, learn: bool) -> Floats:  # noqa: ARG002 - heat is too much for anybody
        heat = now.joint[4]
        before = np.where(np.isnan(self._warm), heat, self._warm)
        self._warm = np.where(np.isnan(heat), before, before + 0.1 * (heat - before))
        if now.step_s:
            self._rise += 0.04 * (or_zero((self._warm - before) / now.step_s) - self._rise)
        coming = np.maximum(self._warm + AHEAD_S * np.maximum(self._rise, 0.0), WARM_C)
        return np.where(np.isfinite(heat), coming, np.nan)

    def words(self, key: str) -> str:
        return f"{readable_name(key.partition('.')[0])}: the motor grows too hot"
