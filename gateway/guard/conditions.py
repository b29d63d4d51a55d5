"""When a number is where it must not be: a band with hysteresis, and I²t as a leaky integrator."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Band:
    """Where a number may lie, its ends included; to be back in it, it must be `hysteresis` inside."""

    low: float
    high: float
    hysteresis: float

    def left(self, value: float, *, tripped: bool) -> bool:
        """Whether `value` is outside of the band, or not far enough back inside."""
        margin = self.hysteresis if tripped else 0.0
        return not self.low + margin <= value <= self.high - margin


class Heat:
    """I²t: the square of a value over its rating, averaged over `time_constant_s`; 0 at first, unitless.

    heat' = ((value / rated)² − heat) / time_constant_s, solved exactly for a value that stays until the next
    one comes. Time without values beyond `longest_s` is not counted: it neither heats nor cools.
    """

    def __init__(self, rated: float, time_constant_s: float, longest_s: float) -> None:
        self.heat = 0.0
        self._rated = rated
        self._time_constant_s = time_constant_s
        self._longest_s = longest_s
        self._load = 0.0
        self._stamp_ns: int | None = None

    def after(self, stamp_ns: int, value: float) -> float:
        """The heat at `stamp_ns`, from when on the value is `value`."""
        if self._stamp_ns is not None:
            elapsed_s = min(max(0, stamp_ns - self._stamp_ns) / 1e9, self._longest_s)
            self.heat += (self._load - self.heat) * -math.expm1(-elapsed_s / self._time_constant_s)
        self._load = (value / self._rated) ** 2
        self._stamp_ns = stamp_ns
        return self.heat
