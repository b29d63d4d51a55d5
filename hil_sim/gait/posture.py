"""Standing, sitting and lying, and the ways between standing and the seat."""

import math

from hil_sim.gait.curves import Leg
from hil_sim.gait.profiles import bump, mix, rise

STANDING = Leg(math.radians(4.0), math.radians(8.0), math.radians(4.0))
SITTING = Leg(math.radians(85.0), math.radians(90.0), math.radians(5.0))
LYING = Leg(math.radians(30.0), math.radians(45.0), math.radians(-10.0))

SEAT_SHARE = 0.82  # of the body weight, on somebody who sits

_LEAN = 0.55  # rad, how far the trunk comes forward between sitting and standing
_TRUNK = 0.30  # m, from the hips to the trunk's centre of mass
_STEP = 0.002  # of seating, for its derivatives


def bent(seating: float) -> float:
    """Return how far the legs are from standing (0) to sitting (1) at a share of the way to the seat."""
    return rise(seating, 0.0, 0.75)


def on_seat(seating: float) -> float:
    """Share of the weight that the seat carries; it comes when the legs are nearly bent."""
    return SEAT_SHARE * rise(seating, 0.68, 0.95)


def lean(seating: float) -> float:
    """Forward lean of the trunk (rad): most when the seat is left or reached."""
    return _LEAN * bump(seating, 0.05, 0.62, 1.0)


def place(seating: float, leg_length: float) -> tuple[float, float]:
    """Return where the trunk's centre of mass is, before and above the ankles (m)."""
    leg = mix(STANDING, SITTING, bent(seating))
    thigh, shank, trunk = leg.hip, leg.hip - leg.knee, lean(seating)
    return (
        _TRUNK * math.sin(trunk) - 0.5 * leg_length * (math.sin(thigh) + math.sin(shank)),
        _TRUNK * math.cos(trunk) + 0.5 * leg_length * (math.cos(thigh) + math.cos(shank)),
    )


def acceleration(seating: float, rate: float, leg_length: float) -> tuple[float, float]:
    """Second derivative of `place` (m/s²) where `seating` changes evenly by `rate` (1/s)."""
    if rate == 0.0:
        return 0.0, 0.0
    before, now, after = (
        place(min(max(seating + shift, 0.0), 1.0), leg_length) for shift in (-_STEP, 0.0, _STEP)
    )
    forward, up = (
        (a - 2.0 * b + c) * (rate / _STEP) ** 2 for a, b, c in zip(before, now, after, strict=True)
    )
    return forward, up
