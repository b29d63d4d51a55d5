"""Stumble and fall: what they add to the motion while they last. Modelled, not measured.

A stumble is the elevating strategy after a trip in early swing (Eng, Winter & Patla 1994): the foot is held,
the trunk pitches, the leg is lifted over and steps quickly. A fall goes forward; its times and peaks lie
where falls recorded at the waist have them (some 0.3 g before the impact, 5 … 6 g in it).
"""

import math
from enum import Enum

from hil_sim.gait.gaits import LEFT
from hil_sim.gait.profiles import bump, rise, smooth

TRIP_PHASE = 0.70  # of the leg that is held: early swing

_HELD_S, _CAUGHT_UP_S = 0.20, 0.55
_STUMBLE_S = 1.4
_PITCH = 0.35  # rad
_KNEE, _HIP = 0.50, 0.30  # rad

_DOWN_S, _IMPACT_S = 0.75, 0.10
_LYING_S = 1.5  # at least
_RISING_S = 4.0
_DROP, _AHEAD = 0.80, 0.50  # m, how far the trunk goes down and forward
LYING_PITCH = 1.20  # rad, of the trunk

# The drop grows with t³ until the impact, which takes its speed away in minimum jerk.
_BEFORE_IMPACT = 1.0 / (1.0 + 1.5 * _IMPACT_S / _DOWN_S)


class Stumble:
    """One trip of the leg `side` and its recovery; idle before the first and after each."""

    def __init__(self) -> None:
        self.side = LEFT
        self._since: float | None = None
        self._rate = 0.0

    @property
    def active(self) -> bool:
        return self._since is not None

    def start(self, side: int, cycle_time: float) -> None:
        self.side, self._since, self._rate = side, 0.0, 1.0 / cycle_time

    def step(self, dt: float) -> None:
        if self._since is not None:
            self._since = self._since + dt if self._since + dt < _STUMBLE_S else None

    def _bump(self, start: float, top: float, end: float) -> float:
        return 0.0 if self._since is None else bump(self._since, start, top, end)

    @property
    def lag(self) -> float:
        """By how much phase the held leg is behind: at the most it just stands still."""
        return self._rate * _HELD_S / 1.875 * self._bump(0.0, _HELD_S, _CAUGHT_UP_S)

    @property
    def hip(self) -> float:
        """Flexion (rad) beyond that of the held leg's step."""
        return _HIP * self._bump(0.15, 0.42, 0.90)

    @property
    def knee(self) -> float:
        return _KNEE * self._bump(0.12, 0.36, 0.65)

    @property
    def pitch(self) -> float:
        """Pitch of the trunk (rad, forward)."""
        return _PITCH * self._bump(0.05, 0.35, 1.30)

    @property
    def acceleration(self) -> float:
        """Acceleration of the trunk, forward (m/s²): the trip brakes, the recovery pushes on by as much."""
        return -8.0 * self._bump(0.0, 0.06, 0.15) + 3.0 * self._bump(0.45, 0.60, 0.85)

    @property
    def load(self) -> float:
        """Factor of the feet's load: the body drops a little, then is caught."""
        return 1.0 - 0.35 * self._bump(0.10, 0.25, 0.40) + 0.70 * self._bump(0.40, 0.46, 0.55)


class FallState(Enum):
    """State of the body."""

    UPRIGHT = 0
    FALLING = 1
    LYING = 2
    RISING = 3


_LASTS = {FallState.FALLING: _DOWN_S + _IMPACT_S, FallState.LYING: _LYING_S, FallState.RISING: _RISING_S}
_THEN = {
    FallState.FALLING: FallState.LYING,
    FallState.LYING: FallState.RISING,
    FallState.RISING: FallState.UPRIGHT,
}


class Fall:
    """Falls to a trunk's `pitch` (rad, forward) and `roll` (rad), lies, and gets up when told to."""

    def __init__(self) -> None:
        self.state = FallState.UPRIGHT
        self.pitch = LYING_PITCH
        self._since = 0.0
        self._roll = 0.0
        self._slipping = False

    def start(self, roll: float, pitch: float = LYING_PITCH, *, slipping: bool = False) -> None:
        """Begin; a foot that is `slipping` bears less at first."""
        self.state, self._since, self._roll = FallState.FALLING, 0.0, roll
        self.pitch, self._slipping = pitch, slipping

    @property
    def load(self) -> float:
        """Factor of the feet's load: a slipping foot bears less for a moment."""
        slips = self._slipping and self.state is FallState.FALLING
        return 1.0 - 0.4 * bump(self._since, 0.0, 0.10, 0.30) if slips else 1.0

    def step(self, dt: float, get_up: bool) -> None:
        if self.state is FallState.UPRIGHT:
            return
        self._since += dt
        stays = self.state is FallState.LYING and not get_up
        if self._since >= _LASTS[self.state] and not stays:
            self.state, self._since = _THEN[self.state], 0.0

    @property
    def share(self) -> float:
        """0 upright … 1 on the ground."""
        return self._motion()[0]

    @property
    def roll(self) -> float:
        return self._roll * self.share

    @property
    def height_acceleration(self) -> float:
        """Vertical acceleration of the trunk (m/s², up)."""
        return -_DROP * self._motion()[1]

    @property
    def acceleration(self) -> float:
        """Acceleration of the trunk, forward (m/s²); getting up is slow and takes nobody back."""
        ahead = _AHEAD * self.pitch / LYING_PITCH
        return ahead * self._motion()[1] if self.state is FallState.FALLING else 0.0

    @property
    def on_ground(self) -> float:
        """Share of the weight that hands, knees and body carry."""
        if self.state is FallState.FALLING:
            return rise(self._since, 0.35 * _DOWN_S, _DOWN_S)
        if self.state is FallState.RISING:
            return 1.0 - rise(self._since, 0.3 * _RISING_S, 0.8 * _RISING_S)
        return 1.0 if self.state is FallState.LYING else 0.0

    def _motion(self) -> tuple[float, float]:
        """Share of the way down and its second derivative (1/s²)."""
        if self.state is FallState.FALLING:
            return _drop(self._since)
        if self.state is FallState.RISING:
            return _stand_up(self._since / _RISING_S)
        return (1.0, 0.0) if self.state is FallState.LYING else (0.0, 0.0)


def _drop(now: float) -> tuple[float, float]:
    if now < _DOWN_S:
        share = now / _DOWN_S
        return _BEFORE_IMPACT * share**3, 6.0 * _BEFORE_IMPACT * share / _DOWN_S**2
    speed = 3.0 * _BEFORE_IMPACT / _DOWN_S
    t = min((now - _DOWN_S) / _IMPACT_S, 1.0)
    way = t - 2.5 * t**4 + 3.0 * t**5 - t**6  # the integral of 1 − smooth
    return _BEFORE_IMPACT + speed * _IMPACT_S * way, -speed / _IMPACT_S * 30.0 * (t * (1.0 - t)) ** 2


def _stand_up(share: float) -> tuple[float, float]:
    return 1.0 - smooth(share), -60.0 * share * (1.0 - share) * (1.0 - 2.0 * share) / _RISING_S**2


def side_of_fall(uniform: float) -> float:
    """Roll of a fall (rad) from a number in 0 … 1: as often to the left as to the right."""
    return math.radians(50.0) * (uniform - 0.5)
