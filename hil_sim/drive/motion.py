"""Reference motion inside a drive: what position and velocity the controller asks of the motor (rad, s)."""

import math
from dataclasses import dataclass
from typing import Protocol


@dataclass(slots=True)
class Reference:
    """Demanded position (rad) and velocity (rad/s)."""

    position: float = 0.0
    velocity: float = 0.0


class Motion(Protocol):
    """A way of moving the reference; `done` once it has arrived."""

    @property
    def done(self) -> bool: ...

    def step(self, reference: Reference, dt: float) -> None:
        """Move the reference on by `dt` seconds."""


class Hold:
    """Stay where the reference is."""

    done = True

    def step(self, reference: Reference, dt: float) -> None:  # noqa: ARG002 - the shape of a motion
        reference.velocity = 0.0


class Track:
    """Cyclic synchronous position: reach each target in a straight line within one period (CiA 402-2 §14)."""

    def __init__(self, target: float, period_s: float) -> None:
        self._target = target
        self._left_s = period_s

    @property
    def done(self) -> bool:
        return self._left_s <= 0.0

    def step(self, reference: Reference, dt: float) -> None:
        if self._left_s <= dt / 2:
            self._left_s = 0.0
            reference.position, reference.velocity = self._target, 0.0
            return
        reference.velocity = (self._target - reference.position) / self._left_s
        reference.position += reference.velocity * dt
        self._left_s -= dt


class Profile:
    """Profile position: a trapezoid of velocity to one target (CiA 402-2 §10)."""

    def __init__(self, target: float, velocity: float, acceleration: float, deceleration: float) -> None:
        self._target = target
        self._velocity = velocity
        self._acceleration = acceleration
        self._deceleration = deceleration
        self.done = False

    def step(self, reference: Reference, dt: float) -> None:
        distance = self._target - reference.position
        reachable = math.sqrt(2.0 * self._deceleration * abs(distance))
        wanted = math.copysign(min(self._velocity, reachable), distance)
        change = wanted - reference.velocity
        rate = self._acceleration if abs(wanted) > abs(reference.velocity) else 2.0 * self._deceleration
        reference.velocity += math.copysign(min(abs(change), rate * dt), change)
        step = reference.velocity * dt
        if abs(distance) <= abs(step) or (distance == 0.0 and abs(reference.velocity) <= rate * dt):
            reference.position, reference.velocity, self.done = self._target, 0.0, True
        else:
            reference.position += step


class RampDown:
    """Slow down to standstill, wherever that is."""

    def __init__(self, deceleration: float) -> None:
        self._deceleration = deceleration
        self.done = False

    def step(self, reference: Reference, dt: float) -> None:
        change = self._deceleration * dt
        if abs(reference.velocity) <= change:
            reference.velocity, self.done = 0.0, True
        else:
            reference.velocity -= math.copysign(change, reference.velocity)
            reference.position += reference.velocity * dt
