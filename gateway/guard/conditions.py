"""Conditions of rules: bands with hysteresis, and derived values: I²t, extrapolation, drift."""

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Band:
    """Allowed range of a number, ends included; to return, it must be `hysteresis` inside."""

    low: float
    high: float
    hysteresis: float

    def left(self, value: float, *, tripped: bool) -> bool:
        """Return whether `value` is outside of the band, or not far enough back inside."""
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
        """Return the heat at `stamp_ns`, from when on the value is `value`."""
        if self._stamp_ns is not None:
            elapsed_s = min(max(0, stamp_ns - self._stamp_ns) / 1e9, self._longest_s)
            self.heat += (self._load - self.heat) * -math.expm1(-elapsed_s / self._time_constant_s)
        self._load = (value / self._rated) ** 2
        self._stamp_ns = stamp_ns
        return self.heat


class StoppingPoint:
    """Stopping point of a joint (rad): it goes on for `reaction_s`, then brakes by `deceleration` (rad/s²).

    Its parts are its position (0) and its velocity (1).
    """

    def __init__(self, deceleration: float, reaction_s: float) -> None:
        self._deceleration = deceleration
        self._reaction_s = reaction_s
        self._known: list[float | None] = [None, None]

    def after(self, part: int, _stamp_ns: int, value: float) -> float | None:
        """With what is known now; `None` where that is not enough."""
        self._known[part] = value
        position, velocity = self._known
        if position is None or velocity is None:
            return None
        braking = velocity * abs(velocity) / (2.0 * self._deceleration)
        return position + velocity * self._reaction_s + braking


class Drift:
    """Movement since `settle_s` after a held stop; 0 without one.

    What has moved by more than `most` counts anew from there: its reason is over when it rests again.
    """

    def __init__(self, held: Callable[[], bool], settle_s: float, most: float) -> None:
        self._held = held
        self._settle_ns = round(settle_s * 1e9)
        self._most = most
        self._since_ns: int | None = None
        self._reference: float | None = None

    def after(self, stamp_ns: int, value: float) -> float:
        """At `stamp_ns` it is at `value`."""
        if not self._held():
            self._since_ns = self._reference = None
            return 0.0
        if self._since_ns is None:
            self._since_ns = stamp_ns
        if stamp_ns - self._since_ns < self._settle_ns:
            return 0.0
        if self._reference is None:
            self._reference = value
        moved = value - self._reference
        if abs(moved) > self._most:
            self._reference = value
        return moved
