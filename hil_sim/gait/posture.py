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


def bent(seating: float) -> float:
    """How far the legs are from standing (0) to sitting (1) at a share of the way to the seat."""
    return rise(seating, 0.0, 0.75)


def on_seat(seating: float) -> float:
    """Share of the weight that the seat carries; it comes when the legs are nearly bent."""
    return SEAT_SHARE * rise(seating, 0.68, 0.95)


def lean(seating: float) -> float:
    """Forward lean of the trunk (rad): most when the seat is left or reached."""
    return _LEAN * bump(seating, 0.05, 0.62, 1.0)


def height(seating: float, leg_length: float) -> float:
    """Height of the trunk's centre of mass over the ankles (m): thigh, shank and the leaning trunk."""
    leg = mix(STANDING, SITTING, bent(seating))
    thigh, shank = leg.hip, leg.hip - leg.knee
    return 0.5 * leg_length * (math.cos(thigh) + math.cos(shank)) + _TRUNK * math.cos(lean(seating))


def height_acceleration(seating: float, rate: float, leg_length: float) -> float:
    """Second derivative of `height` (m/s²) where `seating` changes evenly by `rate` (1/s)."""
    step = 0.002
    before, now, after = (
        height(min(max(seating + shift, 0.0), 1.0), leg_length) for shift in (-step, 0.0, step)
    )
    return (before - 2.0 * now + after) / (step * step) * rate * rate
