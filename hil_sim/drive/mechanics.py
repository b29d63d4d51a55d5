"""Motor, gear and joint as one rotating mass with friction, stops and a load, integrated in fixed steps."""

import math
from dataclasses import dataclass

STEP_S = 0.001

_STICTION_VELOCITY = 0.01  # rad/s, below which friction grows linearly instead of jumping


@dataclass(frozen=True, slots=True)
class JointConstants:
    """What the joint is made of, all seen at the joint. Modelled, in the range of published exoskeletons."""

    inertia: float = 0.8  # kg·m², rotor through the gear and the limb it carries
    viscous_friction: float = 8.0  # N·m·s/rad
    coulomb_friction: float = 3.0  # N·m, of a drive that is energised
    holding_friction: float = 12.0  # N·m, of an unpowered gear that nothing moves
    low_stop: float = math.radians(-60.0)
    high_stop: float = math.radians(130.0)


class Joint:
    """The true joint: position (rad), velocity (rad/s), the motor's torque and the wearer's load (N·m)."""

    def __init__(self, constants: JointConstants, position: float = 0.0) -> None:
        self.constants = constants
        self.position = position
        self.velocity = 0.0
        self.torque = 0.0
        self.load = 0.0
        self.friction_factor = 1.0  # worn or dry bearings: every friction times this, at any time
        self.slipped = 0.0

    @property
    def motor_position(self) -> float:
        """Where the motor stands (rad at the joint): ahead of the joint by what the gear has slipped."""
        return self.position + self.slipped

    def slip(self, radians: float) -> None:
        """The gear jumps teeth: the motor is ahead of the joint by so much more (rad at the joint)."""
        self.slipped += radians

    def step(self, torque: float, max_velocity: float) -> None:
        """Move on by `STEP_S` under `torque` (N·m at the joint); a load counts against the motor."""
        constants = self.constants
        self.torque = torque
        push = torque - self.load
        holding = constants.holding_friction * self.friction_factor
        if torque == 0.0 and self.velocity == 0.0 and abs(push) <= holding:
            return
        velocity = self.velocity
        slip = velocity / (abs(velocity) + _STICTION_VELOCITY)
        friction = constants.viscous_friction * velocity + constants.coulomb_friction * slip
        velocity += (push - friction * self.friction_factor) / constants.inertia * STEP_S
        velocity = min(max(velocity, -max_velocity), max_velocity)
        if torque == 0.0 and abs(velocity) < _STICTION_VELOCITY and abs(push) <= holding:
            velocity = 0.0
        self._move(velocity)

    def _move(self, velocity: float) -> None:
        position = self.position + velocity * STEP_S
        limited = min(max(position, self.constants.low_stop), self.constants.high_stop)
        self.position = limited
        self.velocity = velocity if limited == position else 0.0
