"""(f) Stumbles: a step that is late, or early."""

import math
from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.observation import SIDES, Observation

SHOWS_S: Final = 1.0  # how long an early step is reported


class StepTiming:
    """Lateness, or earliness, of each foot's heel strike, in strides of this wearer."""

    name = "rhythm"
    keys = (*(f"{side} late" for side in SIDES), *(f"{side} early" for side in SIDES))
    least = np.full(4, 0.04)
    needs = "the forces of both insoles, of somebody who walks"

    def __init__(self) -> None:
        self._early = [0.0, 0.0]
        self._until_s = [-math.inf, -math.inf]
        self._before_s = [-math.inf, -math.inf]

    def measure(self, now: Observation, *, learn: bool) -> Floats:  # noqa: ARG002 - it has nothing to learn
        if not now.walking or np.isnan(now.foot[0]).any():
            self._before_s = [leg.strike_s for leg in now.legs]
            return np.full(4, np.nan)
        late = [max((now.at_s - leg.strike_s) / leg.stride_s - 1.0, 0.0) for leg in now.legs]
        for side, leg in enumerate(now.legs):
            if leg.struck:
                share = (leg.strike_s - self._before_s[side]) / leg.stride_s
                self._early[side] = max(1.0 - share, 0.0) if share < 2.0 else 0.0
                self._before_s[side], self._until_s[side] = leg.strike_s, now.at_s + SHOWS_S
        early = [e if now.at_s < until else 0.0 for e, until in zip(self._early, self._until_s, strict=True)]
        return np.array([*late, *early])

    def words(self, key: str) -> str:
        side, _, when = key.partition(" ")
        return f"the {side} foot's step comes too {when}: a stumble"
