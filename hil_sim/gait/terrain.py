"""Legs on stairs and ramps. Modelled, not measured.

The stair curves go through angles that were set by hand, so that peaks and their times lie where the
literature has them for stairs of about 30° (McFadyen & Winter 1988; Riener, Rabuffetti & Frigo 2002). The
ramps bend the level walker's curves as on a slope of 10° (Lay, Hass & Gregor 2006). Hips count from the
upright trunk, as in level walking.
"""

import math
from collections.abc import Sequence

from hil_sim.gait.curves import Curve, Leg, LegCurves
from hil_sim.gait.walk import level


def _curve(degrees: Sequence[float]) -> Curve:
    return Curve([math.radians(angle) for angle in degrees])


# Degrees at every twentieth of the stride, from foot contact on.
STAIRS_UP = LegCurves(
    hip=_curve((52, 51, 48, 44, 39, 33, 27, 21, 15, 10, 5, 2, 3, 12, 27, 42, 53, 58, 58, 55)),
    knee=_curve((62, 64, 62, 57, 51, 44, 36, 28, 21, 15, 11, 12, 22, 44, 68, 86, 92, 87, 76, 66)),
    ankle=_curve((10, 14, 17, 17, 15, 13, 11, 9, 7, 5, 2, -6, -17, -20, -10, 2, 9, 12, 12, 11)),
)
STAIRS_DOWN = LegCurves(
    hip=_curve((14, 13, 12, 11, 10, 8, 7, 6, 5, 5, 7, 11, 17, 25, 31, 35, 34, 29, 23, 17)),
    knee=_curve((9, 15, 21, 24, 24, 23, 23, 25, 29, 36, 46, 58, 72, 84, 90, 85, 70, 48, 26, 12)),
    ankle=_curve((-20, -8, 4, 11, 15, 18, 21, 24, 27, 30, 32, 31, 25, 13, 2, -5, -8, -11, -15, -19)),
)


def stairs_up(phase: float, _step_length: float, _leg_length: float) -> Leg:
    """Return one leg on the way up; the stairs, not the operator, say how long the step is."""
    return STAIRS_UP.at(phase)


def stairs_down(phase: float, _step_length: float, _leg_length: float) -> Leg:
    return STAIRS_DOWN.at(phase)


def _wave(mean_deg: float, swing_deg: float, top: float, phase: float) -> float:
    return math.radians(mean_deg + swing_deg * math.cos(math.tau * (phase - top)))


def ramp_up(phase: float, step_length: float, leg_length: float) -> Leg:
    """Return a leg on a ramp upwards, where the foot meets the ground higher.

    Hip and knee are bent more then, the ankle all through stance.
    """
    pose = level(phase, step_length, leg_length)
    return Leg(
        pose.hip + _wave(7.0, 7.0, 0.95, phase),
        pose.knee + _wave(7.0, 7.0, 0.0, phase),
        pose.ankle + _wave(5.0, 3.0, 0.3, phase),
    )


def ramp_down(phase: float, step_length: float, leg_length: float) -> Leg:
    """Return a leg whose knee bends in late stance, lowering the body."""
    pose = level(phase, step_length, leg_length)
    return Leg(
        pose.hip + _wave(-3.0, 3.0, 0.45, phase),
        pose.knee + _wave(7.0, 7.0, 0.45, phase),
        pose.ankle + _wave(-3.0, 3.0, 0.5, phase),
    )
