"""The stride as a clock: its phase, and how much each stride differs from the last."""

import math
import random
from collections.abc import Sequence
from typing import NamedTuple

# Standard deviations between the strides of one healthy adult (1 … 3 % of the stride time: Hausdorff 2005,
# J. NeuroEng. Rehabil. 2:19), and how much of a deviation the next stride keeps.
_CYCLE, _STEP, _TOE = 0.02, 0.03, 0.08
_KEPT = 0.4
_MOST = 2.5  # deviations

FIRST_PHASE = 0.85  # the left leg begins with the end of a swing


class Deviations(NamedTuple):
    """Factors of this stride."""

    cycle: float = 1.0
    left_step: float = 1.0
    right_step: float = 1.0
    toe: float = 1.0


class Rhythm:
    """The phase of the left stride (0 … 1); without a random source every stride is like the other."""

    def __init__(self, variability: float, source: random.Random | None) -> None:
        self._spread = [variability * one for one in (_CYCLE, _STEP, _STEP, _TOE)]
        self._source = source
        self._walk = [0.0] * len(self._spread)
        self.phase = FIRST_PHASE
        self.deviations = Deviations()

    def rest(self) -> None:
        """Rest: nobody walks, and the next stride begins anew."""
        self.phase = FIRST_PHASE

    def step(self, dt: float, cycle_time: float) -> None:
        phase = self.phase + dt / cycle_time
        if phase >= 1.0:
            phase -= 1.0
            self._next_stride()
        self.phase = phase

    def _next_stride(self) -> None:
        if self._source is None:
            return
        fresh = math.sqrt(1.0 - _KEPT * _KEPT)
        self._walk = [_KEPT * old + fresh * self._source.gauss(0.0, 1.0) for old in self._walk]
        self.deviations = Deviations(
            *(
                1.0 + spread * min(max(one, -_MOST), _MOST)
                for spread, one in zip(self._spread, self._walk, strict=True)
            )
        )


class Lag:
    """Values that follow others in about three times `seconds`, with no jump in speed (two lags in a row)."""

    def __init__(self, seconds: float, values: Sequence[float]) -> None:
        self._seconds = seconds
        self._between = list(values)
        self.values = list(values)

    def step(self, dt: float, wanted: Sequence[float]) -> None:
        share = 1.0 - math.exp(-dt / self._seconds)
        self._between = [now + share * (to - now) for now, to in zip(self._between, wanted, strict=True)]
        self.values = [now + share * (to - now) for now, to in zip(self.values, self._between, strict=True)]
