"""Reference motion inside a drive: the position, velocity and torque that it demands (rad, s, N·m)."""

import math
from dataclasses import dataclass
from typing import Protocol


@dataclass(slots=True)
class Reference:
    """Present demand; `torque` is added to the control's output for the others."""

    position: float = 0.0
    velocity: float = 0.0
    torque: float = 0.0


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


class Profile:
    """Profile position: a trapezoid of velocity to one target (CiA 402-2 §10).

    With `through` it passes the target at speed, because the next set-point is waiting.
    """

    def __init__(self, target: float, velocity: float, acceleration: float, deceleration: float) -> None:
        self.target = target
        self.through = False
        self.done = False
        self._velocity = velocity
        self._acceleration = acceleration
        self._deceleration = deceleration

    def step(self, reference: Reference, dt: float) -> None:
        if self.done:
            reference.position += reference.velocity * dt
            return
        distance = self.target - reference.position
        speed = self._velocity
        if not self.through:
            speed = min(speed, math.sqrt(2.0 * self._deceleration * abs(distance)))
        wanted = math.copysign(speed, distance)
        change = wanted - reference.velocity
        rate = self._acceleration if abs(wanted) > abs(reference.velocity) else 2.0 * self._deceleration
        reference.velocity += math.copysign(min(abs(change), rate * dt), change)
        step = reference.velocity * dt
        if abs(distance) <= abs(step) or (distance == 0.0 and abs(reference.velocity) <= rate * dt):
            self._arrive(reference, step)
        else:
            reference.position += step

    def _arrive(self, reference: Reference, step: float) -> None:
        self.done = True
        if self.through:
            reference.position += step
        else:
            reference.position, reference.velocity = self.target, 0.0


class VelocityRamp:
    """Change the velocity to `target` and keep it; at 0 this is how a drive slows down."""

    def __init__(self, target: float, acceleration: float, deceleration: float) -> None:
        self.target = target
        self.acceleration = acceleration
        self.deceleration = deceleration
        self.done = False

    def step(self, reference: Reference, dt: float) -> None:
        velocity = reference.velocity
        change = self.target - velocity
        most = (self.acceleration if change * velocity > 0.0 or not velocity else self.deceleration) * dt
        self.done = abs(change) <= most
        reference.velocity = self.target if self.done else velocity + math.copysign(most, change)
        reference.position += reference.velocity * dt


class TorqueRamp:
    """Change the torque to `target` by `slope` (N·m/s) and keep it."""

    def __init__(self) -> None:
        self.done = False
        self._target = self._slope = 0.0

    def aim(self, target: float, slope: float) -> None:
        """Go on to `target`, whatever it was before."""
        self.done = self.done and target == self._target
        self._target, self._slope = target, slope

    def step(self, reference: Reference, dt: float) -> None:
        change, most = self._target - reference.torque, self._slope * dt
        self.done = abs(change) <= most
        reference.torque = self._target if self.done else reference.torque + math.copysign(most, change)


class _Track:
    """Cyclic synchronous: reach each target in a straight line within one period (CiA 402-2 §14–16)."""

    def __init__(self, target: float, period_s: float) -> None:
        self._target = target
        self._left_s = period_s

    @property
    def done(self) -> bool:
        return self._left_s <= 0.0

    def _share(self, dt: float) -> float:
        """Return this step's share of the remaining way."""
        share = dt / self._left_s if self._left_s > 1.5 * dt else 1.0
        self._left_s = self._left_s - dt if share < 1.0 else 0.0
        return share


class TrackPosition(_Track):
    """Cyclic synchronous position."""

    def step(self, reference: Reference, dt: float) -> None:
        way = 0.0 if self._left_s <= 0.0 else (self._target - reference.position) * self._share(dt)
        reference.position += way
        reference.velocity = way / dt


class TrackVelocity(_Track):
    """Cyclic synchronous velocity."""

    def step(self, reference: Reference, dt: float) -> None:
        if not self.done:
            reference.velocity += (self._target - reference.velocity) * self._share(dt)
        reference.position += reference.velocity * dt


class TrackTorque(_Track):
    """Cyclic synchronous torque."""

    def step(self, reference: Reference, dt: float) -> None:
        if not self.done:
            reference.torque += (self._target - reference.torque) * self._share(dt)
