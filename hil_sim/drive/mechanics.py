"""Rotor, gear and joint as one turning mass with friction, end stops and a load, in fixed steps."""

import math
from dataclasses import dataclass

STEP_S = 0.001


@dataclass(frozen=True, slots=True)
class JointConstants:
    """Mechanical constants, all seen at the joint. Modelled, in the range of published exoskeletons."""

    inertia: float = 0.4  # kg·m², of the limb; the rotor's comes to it through the gear
    viscous_friction: float = 8.0  # N·m·s/rad
    coulomb_friction: float = 3.0  # N·m
    holding_friction: float = 12.0  # N·m, of an unpowered gear that nothing moves
    gear_efficiency: float = 0.95  # the rest of the motor's torque is friction in the gear
    low_stop: float = math.radians(-60.0)
    high_stop: float = math.radians(130.0)
    stop_stiffness: float = 50_000.0  # N·m/rad
    stop_damping: float = 200.0  # N·m·s/rad: little comes back from a stop
    limit_switch: float = math.radians(2.0)  # how far before its stop a limit switch closes
    home_switch: tuple[float, float] | None = None  # from where to where it is closed; None: there is none


class Joint:
    """The true joint: position (rad), velocity (rad/s), and the wearer's load (N·m, against the motor).

    `friction_factor` multiplies every friction, as worn or dry bearings do; `creep` is how fast (rad/s) the
    joint gives way without power. Both may be set at any time.
    `rotor_inertia` (kg·m², through the gear) is the motor's own. On a bench `gravity` is what the limb weighs
    where it is level (N·m), which hangs down at 0; `cogging` what the motor's teeth do (N·m at the joint),
    `cogging_cycles` times a turn of the joint. Both are 0 where a wearer stands in the robot.
    """

    def __init__(self, constants: JointConstants, position: float = 0.0) -> None:
        self.constants = constants
        self.position = position
        self.velocity = 0.0
        self.load = 0.0
        self.rotor_inertia = 0.0
        self.friction_factor = 1.0
        self.creep = 0.0
        self.slipped = 0.0
        self.gravity = 0.0
        self.cogging = 0.0
        self.cogging_cycles = 0.0

    @property
    def motor_position(self) -> float:
        """Where the motor stands (rad at the joint): ahead of the joint by what the gear has slipped."""
        return self.position + self.slipped

    def slip(self, radians: float) -> None:
        """Let the gear jump teeth: the joint falls behind the motor by this (rad), up to its stop."""
        motor, constants = self.motor_position, self.constants
        self.position = min(max(self.position - radians, constants.low_stop), constants.high_stop)
        self.slipped = motor - self.position

    @property
    def at_low_switch(self) -> bool:
        return self.position <= self.constants.low_stop + self.constants.limit_switch

    @property
    def at_home_switch(self) -> bool:
        switch = self.constants.home_switch
        return switch is not None and switch[0] <= self.position <= switch[1]

    @property
    def at_high_switch(self) -> bool:
        return self.position >= self.constants.high_stop - self.constants.limit_switch

    def step(self, torque: float) -> None:
        """Move on by `STEP_S` under the motor's `torque` (N·m at the joint).

        Friction is taken implicitly: it stops a motion, it never turns one round, whatever the step.
        """
        constants = self.constants
        position, factor = self.position, self.friction_factor
        push = torque - self.load
        if self.gravity or self.cogging:
            push -= self._bench_torque()
        if not constants.low_stop <= position <= constants.high_stop:
            push += self._stop_torque()
        share = STEP_S / (constants.inertia + self.rotor_inertia)
        velocity = (self.velocity + push * share) / (1.0 + constants.viscous_friction * factor * share)
        friction = constants.coulomb_friction + (1.0 - constants.gear_efficiency) * abs(torque)
        drag = friction * factor * share
        if velocity > drag:
            velocity -= drag
        elif velocity < -drag:
            velocity += drag
        else:
            velocity = 0.0
        self.velocity = velocity
        self.position = position + velocity * STEP_S

    def coast(self) -> None:
        """Move on by `STEP_S` without power: what stands still is held by the gear."""
        self.position += self.creep * STEP_S
        holding = self.constants.holding_friction * self.friction_factor
        if self.velocity or abs(self.load) > holding:
            self.step(0.0)

    def _bench_torque(self) -> float:
        teeth = math.sin(self.cogging_cycles * self.motor_position)
        return self.gravity * math.sin(self.position) + self.cogging * teeth

    def _stop_torque(self) -> float:
        """Return a stop pushes back and never pulls."""
        constants = self.constants
        damping = constants.stop_damping * self.velocity
        if self.position > constants.high_stop:
            return min(constants.stop_stiffness * (constants.high_stop - self.position) - damping, 0.0)
        return max(constants.stop_stiffness * (constants.low_stop - self.position) - damping, 0.0)
