"""(h) Heat that will be too much: a motor's temperature, prolonged at its present rise."""

from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.now import JOINTS, Now, or_zero, spoken

AHEAD_S: Final = 15.0  # how far ahead it is looked
WARM_C: Final = 40.0  # below that nothing is said


class Drift:
    """Temperature in some seconds; what drifts from stride to stride is compared in `strides`."""

    name = "drift"
    keys = tuple(f"{joint}.heat" for joint in JOINTS)
    least = np.full(6, 8.0)  # °C
    needs = "a motor's temperature"

    def __init__(self) -> None:
        self._warm = np.full(6, np.nan)
        self._rise = np.zeros(6)  # °C/s

    def measure(self, now: Now, *, learn: bool) -> Floats:  # noqa: ARG002 - heat is too much for anybody
        heat = now.joint[4]
        before = np.where(np.isnan(self._warm), heat, self._warm)
        self._warm = np.where(np.isnan(heat), before, before + 0.1 * (heat - before))
        if now.step_s:
            self._rise += 0.04 * (or_zero((self._warm - before) / now.step_s) - self._rise)
        coming = np.maximum(self._warm + AHEAD_S * np.maximum(self._rise, 0.0), WARM_C)
        return np.where(np.isfinite(heat), coming, np.nan)

    def words(self, key: str) -> str:
        return f"{spoken(key.partition('.')[0])}: the motor grows too hot"
