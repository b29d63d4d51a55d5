"""The motion that the gait controller asks for: standing, walking, sitting, and smooth ways between them."""

import math
from enum import IntEnum

from hil_sim.gait.curves import Leg
from hil_sim.gait.walk import Shape, leg


class Activity(IntEnum):
    """What the wearer is to do (object 2005h of the gait controller)."""

    STAND = 0
    WALK = 1
    SIT = 2


STANDING = Leg(math.radians(4.0), math.radians(8.0), math.radians(4.0))
SITTING = Leg(math.radians(85.0), math.radians(90.0), math.radians(5.0))

_WALK_RAMP_S = 1.5
_SIT_RAMP_S = 2.5
_SHAPE_TIME_S = 0.4  # a changed parameter is taken over in about three of these
_RISE_LEAN = 0.35  # rad, how far the trunk comes forward half-way between sitting and standing
_FIRST_PHASE = 0.85  # the left leg begins with the end of a swing


def smooth(share: float) -> float:
    """0 … 1 to 0 … 1 with no jump in speed or acceleration (minimum jerk)."""
    return share**3 * (10.0 - 15.0 * share + 6.0 * share * share)


class Generator:
    """The present phase, activity and shape; `step` moves them on, the rest says what they mean."""

    def __init__(self, shape: Shape) -> None:
        self.reset(shape)

    def reset(self, shape: Shape) -> None:
        """Stand, with this shape for the steps to come."""
        self.phase = _FIRST_PHASE
        self.shape = shape
        self._walk_share = 0.0
        self._sit_share = 0.0

    @property
    def walking(self) -> float:
        """0 standing … 1 walking."""
        return smooth(self._walk_share)

    @property
    def sitting(self) -> float:
        """0 upright … 1 sitting."""
        return smooth(self._sit_share)

    @property
    def trunk(self) -> float:
        """Forward lean of the trunk (rad)."""
        return self.shape.trunk_angle + _RISE_LEAN * 4.0 * self.sitting * (1.0 - self.sitting)

    def step(self, dt: float, activity: Activity, wanted: Shape) -> None:
        """Move on by `dt` seconds towards `activity` and `wanted`; one stands between walking and sitting."""
        self.shape = self._approach(wanted, 1.0 - math.exp(-dt / _SHAPE_TIME_S))
        may_walk = activity is Activity.WALK and self._sit_share == 0.0
        may_sit = activity is Activity.SIT and self._walk_share == 0.0
        self._walk_share = _ramp(self._walk_share, may_walk, dt / _WALK_RAMP_S)
        self._sit_share = _ramp(self._sit_share, may_sit, dt / _SIT_RAMP_S)
        if self._walk_share > 0.0:
            self.phase = (self.phase + dt / self.shape.cycle_time) % 1.0
        else:
            self.phase = _FIRST_PHASE

    def legs(self) -> tuple[Leg, Leg]:
        """Left and right leg; they walk in anti-phase."""
        return self._leg(self.phase), self._leg((self.phase + 0.5) % 1.0)

    def _leg(self, phase: float) -> Leg:
        walking, sitting = self.walking, self.sitting
        pose = STANDING if walking == 0.0 else _mix(STANDING, leg(phase, self.shape), walking)
        pose = _mix(pose, SITTING, sitting)
        return pose._replace(hip=pose.hip + self.trunk)

    def _approach(self, wanted: Shape, share: float) -> Shape:
        now = self.shape
        return Shape(
            now.step_length + share * (wanted.step_length - now.step_length),
            now.cycle_time + share * (wanted.cycle_time - now.cycle_time),
            now.toe_height + share * (wanted.toe_height - now.toe_height),
            now.trunk_angle + share * (wanted.trunk_angle - now.trunk_angle),
        )


def _ramp(share: float, up: bool, change: float) -> float:
    return min(max(share + (change if up else -change), 0.0), 1.0)


def _mix(a: Leg, b: Leg, share: float) -> Leg:
    return Leg(*(x + share * (y - x) for x, y in zip(a, b, strict=True)))
