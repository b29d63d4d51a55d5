"""The searches of each homing method, and the motion of a search (CiA 402-2 §11)."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum

from hil_sim.drive.mechanics import Joint
from hil_sim.drive.motion import Reference, VelocityRamp
from hil_sim.drive.servo import Servo
from hil_sim.drive.settings import Settings


class Until(Enum):
    """End of a search."""

    SWITCH_CLOSED = "the limit switch behind which the search began or to which it goes is closed"
    SWITCH_OPEN = "it is open again"
    HOME_CLOSED = "the home switch is closed"
    HOME_OPEN = "it is open"
    INDEX = "the encoder has shown its index, once a revolution of the motor"


@dataclass(frozen=True, slots=True)
class Search:
    """Move in a direction (−1 or 1) until something is seen; `turns` where a limit switch comes first."""

    direction: float
    speed: Callable[[Settings], float]
    until: Until
    turns: bool = False


def _switch_speed(settings: Settings) -> float:
    return settings.homing_switch_speed


def _zero_speed(settings: Settings) -> float:
    return settings.homing_zero_speed


@dataclass(frozen=True, slots=True)
class ByLimit:
    """Methods 1, 2, 17 and 18: the limit switch in a direction, from where it opens again, and an index."""

    direction: float
    index: bool

    def searches(self, _joint: Joint) -> list[Search]:
        found = [
            Search(self.direction, _switch_speed, Until.SWITCH_CLOSED),
            Search(-self.direction, _zero_speed, Until.SWITCH_OPEN),
        ]
        return [*found, _to_index(-self.direction)] if self.index else found


@dataclass(frozen=True, slots=True)
class ByHome:
    """Methods 3 to 14 and 19 to 30: an edge of the home switch, passed in a direction, and an index.

    It `opens` there or closes. Where the switch is not seen the search begins in `first`, and those from 7 on
    and from 23 on turn round at the limit switch.
    """

    first: float
    direction: float
    opens: bool
    turns: bool
    index: bool

    def searches(self, joint: Joint) -> list[Search]:
        found = list(self._edge(joint.at_home_switch))
        return [*found, _to_index(self.direction)] if self.index else found

    def _edge(self, closed: bool) -> Iterator[Search]:
        if not closed:
            yield Search(self.first, _switch_speed, Until.HOME_CLOSED, self.turns)
        if not self.opens:
            yield Search(-self.direction, _zero_speed, Until.HOME_OPEN)
        yield Search(self.direction, _zero_speed, Until.HOME_OPEN if self.opens else Until.HOME_CLOSED)


@dataclass(frozen=True, slots=True)
class Plain:
    """Methods 33 and 34: the next index; 35 and 37: where it is."""

    direction: float | None = None

    def searches(self, _joint: Joint) -> list[Search]:
        return [] if self.direction is None else [_to_index(self.direction)]


def _to_index(direction: float) -> Search:
    return Search(direction, _zero_speed, Until.INDEX)


# Methods 3 to 14; those from 19 on have no index. As in `ByHome`: first, direction, opens, turns.
_EDGES = (
    (1.0, -1.0, True, False),  # 3
    (1.0, 1.0, False, False),
    (-1.0, 1.0, True, False),
    (-1.0, -1.0, False, False),
    (1.0, -1.0, True, True),  # 7
    (1.0, 1.0, False, True),
    (1.0, -1.0, False, True),
    (1.0, 1.0, True, True),
    (-1.0, 1.0, True, True),  # 11
    (-1.0, -1.0, False, True),
    (-1.0, 1.0, False, True),
    (-1.0, -1.0, True, True),
)

# 6098h. Which of them a drive has its 60E3h says, where it has one.
METHODS: dict[int, ByLimit | ByHome | Plain] = {
    1: ByLimit(-1.0, index=True),
    2: ByLimit(1.0, index=True),
    **{number: ByHome(*edge, index=True) for number, edge in enumerate(_EDGES, start=3)},
    17: ByLimit(-1.0, index=False),
    18: ByLimit(1.0, index=False),
    **{number: ByHome(*edge, index=False) for number, edge in enumerate(_EDGES, start=19)},
    33: Plain(-1.0),
    34: Plain(1.0),
    35: Plain(),
    37: Plain(),
}


class Seeking:
    """The motion of one search; `found` is the drive's position (rad) at which it saw what it looks for."""

    def __init__(self, servo: Servo, search: Search) -> None:
        self.found: float | None = None
        self.blocked = False
        self._servo = servo
        self._search = search
        self._direction = search.direction
        self._turns = search.turns
        self._ramp = self._towards(search.direction)
        self._turn = self._revolution()

    @property
    def done(self) -> bool:
        return self.found is not None or self.blocked

    def _towards(self, direction: float) -> VelocityRamp:
        acceleration = self._servo.settings.homing_acceleration
        velocity = direction * self._search.speed(self._servo.settings)
        return VelocityRamp(velocity, acceleration, acceleration)

    def _revolution(self) -> int:
        return math.floor(self._servo.joint.motor_position * self._servo.settings.gear / math.tau)

    def step(self, reference: Reference, dt: float) -> None:
        self._ramp.step(reference, dt)
        if not self.done:
            self._look()

    def _look(self) -> None:
        until = self._search.until
        if until is Until.INDEX:
            self._look_for_index()
        elif self._sees(until):
            self.found = self._servo.position
        if self.found is None and until is not Until.SWITCH_CLOSED and self._switch(self._direction):
            self._at_limit()

    def _at_limit(self) -> None:
        """Turn back once if the method allows it; else fail."""
        if self._turns:
            self._turns, self._direction = False, -self._direction
            self._ramp = self._towards(self._direction)
        else:
            self.blocked = True

    def _sees(self, until: Until) -> bool:
        joint = self._servo.joint
        if until in (Until.HOME_CLOSED, Until.HOME_OPEN):
            return joint.at_home_switch is (until is Until.HOME_CLOSED)
        return (
            self._switch(self._direction)
            if until is Until.SWITCH_CLOSED
            else not self._switch(-self._direction)
        )

    def _look_for_index(self) -> None:
        """Latch the index at the start of a revolution, as hardware does between two steps."""
        before, self._turn = self._turn, self._revolution()
        if self._turn != before:
            servo = self._servo
            index = max(before, self._turn) * math.tau / servo.settings.gear
            self.found = servo.position + index - servo.joint.motor_position

    def _switch(self, direction: float) -> bool:
        joint = self._servo.joint
        return joint.at_high_switch if direction > 0.0 else joint.at_low_switch
