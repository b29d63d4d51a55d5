"""Homing: find where the joint is by limit switches and the encoder's index (CiA 402-2 §11).

The home position then counts as 607Ch, in method 37 and in every other.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from hil_sim.drive import objects as od
from hil_sim.drive.modes.mode import BIT_12, BIT_13, TARGET_REACHED, Mode
from hil_sim.drive.motion import Reference, VelocityRamp
from hil_sim.drive.options import Ramp
from hil_sim.drive.servo import Servo
from hil_sim.drive.settings import Settings

START = 1 << 4  # of the controlword


class Until(Enum):
    """What ends a search."""

    SWITCH_CLOSED = "the limit switch behind which the search began or to which it goes is closed"
    SWITCH_OPEN = "it is open again"
    INDEX = "the encoder has shown its index, once a revolution of the motor"


@dataclass(frozen=True, slots=True)
class Search:
    """Move in a direction (−1 or 1) until something is seen."""

    direction: float
    speed: Callable[[Settings], float]
    until: Until


def _switch_speed(settings: Settings) -> float:
    return settings.homing_switch_speed


def _zero_speed(settings: Settings) -> float:
    return settings.homing_zero_speed


def _by_switch(direction: float) -> tuple[Search, ...]:
    return (
        Search(direction, _switch_speed, Until.SWITCH_CLOSED),
        Search(-direction, _zero_speed, Until.SWITCH_OPEN),
    )


def _to_index(direction: float) -> Search:
    return Search(direction, _zero_speed, Until.INDEX)


# 6098h. Methods with a home switch are not here: the joint has none.
METHODS: dict[int, tuple[Search, ...]] = {
    1: (*_by_switch(-1.0), _to_index(1.0)),
    2: (*_by_switch(1.0), _to_index(-1.0)),
    17: _by_switch(-1.0),
    18: _by_switch(1.0),
    33: (_to_index(-1.0),),
    34: (_to_index(1.0),),
    35: (),
    37: (),
}
NO_METHOD = 0


class _Seeking:
    """The motion of one search; `found` is the drive's position (rad) at which it saw what it looks for."""

    def __init__(self, servo: Servo, search: Search) -> None:
        self.found: float | None = None
        self.blocked = False
        self._servo = servo
        self._search = search
        acceleration = servo.settings.homing_acceleration
        velocity = search.direction * search.speed(servo.settings)
        self._ramp = VelocityRamp(velocity, acceleration, acceleration)
        self._turn = self._revolution()

    @property
    def done(self) -> bool:
        return self.found is not None or self.blocked

    def _revolution(self) -> int:
        return math.floor(self._servo.joint.motor_position * self._servo.settings.gear / math.tau)

    def step(self, reference: Reference, dt: float) -> None:
        self._ramp.step(reference, dt)
        if not self.done:
            self._look()

    def _look(self) -> None:
        servo, until = self._servo, self._search.until
        if until is Until.INDEX:
            self._look_for_index()
        elif self._ahead() if until is Until.SWITCH_CLOSED else not self._behind():
            self.found = servo.position
        self.blocked = self.found is None and until is not Until.SWITCH_CLOSED and self._ahead()

    def _look_for_index(self) -> None:
        """The index lies where a revolution begins; it is latched in hardware, between two steps."""
        before, self._turn = self._turn, self._revolution()
        if self._turn != before:
            servo = self._servo
            index = max(before, self._turn) * math.tau / servo.settings.gear
            self.found = servo.position + index - servo.joint.motor_position

    def _ahead(self) -> bool:
        return self._switch(self._search.direction)

    def _behind(self) -> bool:
        return self._switch(-self._search.direction)

    def _switch(self, direction: float) -> bool:
        joint = self._servo.joint
        return joint.at_high_switch if direction > 0.0 else joint.at_low_switch


class _State(Enum):
    IDLE = TARGET_REACHED  # not started, or interrupted
    SEARCHING = 0
    ATTAINED = BIT_12  # home is known, the joint comes to rest
    COMPLETE = BIT_12 | TARGET_REACHED
    FAILED = BIT_13


class Homing(Mode):
    """Runs the searches of the method one after the other, from the rising edge of bit 4."""

    follows_position = True

    def enter(self) -> None:
        super().enter()
        self._state = _State.IDLE
        self._left: list[Search] = []
        self._seeking: _Seeking | None = None

    def command(self, controlword: int, risen: int) -> None:
        super().command(controlword, risen)
        if risen & START and not self.halted:
            self._start()
        elif not controlword & START and self._state is _State.SEARCHING:
            self.halt()

    def halt(self) -> None:
        super().halt()
        if self._state is _State.SEARCHING:
            self._state = _State.IDLE

    def _start(self) -> None:
        method = self.objects.number(od.HOMING_METHOD)
        if method not in METHODS:
            self._state = _State.FAILED
            return
        self._state = _State.SEARCHING
        self.servo.hold()
        self._left = list(METHODS[method])
        self._next(self.servo.position)

    def _next(self, found: float) -> None:
        """Begin the next search; after the last one `found` is home."""
        if self._left:
            self._seeking = _Seeking(self.servo, self._left.pop(0))
            self.servo.motion = self._seeking
            return
        self.servo.stop(Ramp.SLOW_DOWN)
        self.servo.home(self.servo.settings.home_offset - found)
        self._state = _State.ATTAINED

    def update(self, elapsed_s: float) -> None:  # noqa: ARG002 - the shape of a mode
        seeking = self._seeking
        if self._state is _State.SEARCHING and seeking is not None:
            if seeking.found is not None:
                self._next(seeking.found)
            elif seeking.blocked:
                self.servo.stop(Ramp.QUICK_STOP)
                self._state = _State.FAILED
        elif self._state is _State.ATTAINED and self.servo.at_rest:
            self._state = _State.COMPLETE

    def status(self) -> int:
        resting = TARGET_REACHED if self._state is _State.FAILED and self.servo.at_rest else 0
        return self._state.value | resting
