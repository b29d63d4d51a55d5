"""The servo: cascade control of current, velocity and position, on a motor that really moves."""

import math
from dataclasses import dataclass

from hil_sim.drive.encoder import Encoder
from hil_sim.drive.mechanics import STEP_S, Joint
from hil_sim.drive.motion import Hold, Motion, Reference, VelocityRamp
from hil_sim.drive.options import Ramp
from hil_sim.drive.settings import Control, Parameters, Settings
from hil_sim.drive.thermal import Thermal

_STANDSTILL = 0.02  # rad/s


@dataclass(slots=True)
class Offsets:
    """Additive terms of a cyclic master (60B1h, 60B2h)."""

    velocity: float = 0.0
    torque: float = 0.0


class Servo:
    """Motor and control without any bus; all in rad, s and N·m at the joint, as the drive counts them.

    `position` is what the drive believes: the encoder's reading, moved by what homing has found.
    """

    def __init__(self, joint: Joint, parameters: Parameters) -> None:
        self.joint = joint
        self.encoder = Encoder(parameters.now.counts_per_radian)
        self.thermal = Thermal()
        self.control = Control.POSITION
        self.reference = Reference()
        self.offsets = Offsets()
        self.motion: Motion = Hold()
        self.torque = 0.0  # of the motor, from the current that really flows
        self.demand = 0.0  # the torque that the control asks for, within the limits
        self.strength = 1.0  # share of the torque that the current makes: less where the magnets are weak
        self.limited = False  # the control asks for more than the limits allow
        self.origin = 0.0
        self.homed = False
        joint.rotor_inertia = parameters.now.rotor_inertia
        self._parameters = parameters
        self._integral = 0.0
        self._seen_velocity = 0.0  # filtered
        self.hold()

    @property
    def settings(self) -> Settings:
        return self._parameters.now

    @property
    def position(self) -> float:
        return self.encoder.read(self.joint.motor_position) + self.origin

    @property
    def velocity(self) -> float:
        return 0.0 if self.encoder.stuck else self.joint.velocity

    @property
    def following_error(self) -> float:
        return self.reference.position - self.position

    @property
    def standing(self) -> bool:
        return abs(self.velocity) < _STANDSTILL

    @property
    def at_rest(self) -> bool:
        """The motion has ended and the joint stands."""
        return self.motion.done and self.standing

    # -- what to do ------------------------------------------------------------------------------------

    def use(self, control: Control) -> None:
        """Close another loop, beginning with what the joint does now, so that nothing jumps."""
        self.control = control
        velocity = 0.0 if control is Control.TORQUE else self.velocity
        self.reference = Reference(self.position, velocity, self.torque if control is Control.TORQUE else 0.0)
        self.offsets = Offsets()
        self.motion = Hold()
        self._integral = 0.0

    def hold(self) -> None:
        """Demand the position where the joint is."""
        self.use(Control.POSITION)
        self.reference.velocity = 0.0

    def stop(self, ramp: Ramp) -> None:
        """Slow down to standstill, from whatever loop was closed."""
        hard = ramp is Ramp.CURRENT_LIMIT
        self.use(Control.VELOCITY if hard else Control.POSITION)
        deceleration = math.inf if hard else self._deceleration(ramp)
        self.motion = VelocityRamp(0.0, deceleration, deceleration)

    def _deceleration(self, ramp: Ramp) -> float:
        settings = self.settings
        return settings.quick_stop_deceleration if ramp is Ramp.QUICK_STOP else settings.deceleration

    def home(self, shift: float) -> None:
        """Count positions further by `shift` from now on; nothing moves."""
        self.origin += shift
        self.reference.position += shift
        self.homed = True

    def forget_home(self) -> None:
        """Count as the encoder does."""
        self.home(-self.origin)
        self.homed = False

    # -- motion ----------------------------------------------------------------------------------------

    def limits(self) -> tuple[float, float]:
        """Return the lowest and highest torque that objects and the winding's heat allow."""
        settings = self.settings
        rated = settings.rated_torque
        highest, lowest = settings.highest_torque, settings.lowest_torque
        if self.thermal.reduced:
            share = self.thermal.peak_share
            highest = min(highest, rated + share * max(highest - rated, 0.0))
            lowest = max(lowest, -rated + share * min(lowest + rated, 0.0))
        return lowest, highest

    def run(self, steps: int, supply_v: float) -> None:
        """Let the powered motor move the joint for so many steps."""
        settings = self.settings
        gains = settings.gains[self.control]
        stiffness, damping, reach = gains.stiffness, gains.damping, gains.reach
        gain, growth, windup = settings.current_gain, gains.integral * STEP_S, gains.integral_limit
        lead, reference, motion = gains.feed_forward, self.reference, self.motion
        more_velocity, more_torque = self.offsets.velocity, self.offsets.torque
        lowest, highest = self.limits()
        # What the supply leaves after the back EMF falls with the speed; a speed limit acts like less supply.
        droop = settings.torque_per_volt * settings.back_emf
        top_speed = min(settings.top_speed, supply_v / settings.back_emf)
        joint, strength = self.joint, self.strength
        turning = 0.0 if self.encoder.stuck else 1.0  # whether the encoder shows what moves
        shift = self.position - turning * joint.position
        blend = STEP_S / (STEP_S + settings.velocity_filter_s)
        actual, demand, integral, seen = self.torque, self.demand, self._integral, self._seen_velocity
        wanted = demand
        for _ in range(steps):
            actual += gain * (demand - actual)  # what the last step has computed
            joint.step(strength * actual)
            motion.step(reference, STEP_S)
            speed = joint.velocity
            seen += blend * (turning * speed - seen)
            error = reference.position - turning * joint.position - shift
            if not -reach <= error <= reach:
                reference.position -= error - math.copysign(reach, error)
                error = math.copysign(reach, error)
            wanted = (
                stiffness * error
                + damping * (lead * reference.velocity + more_velocity - seen)
                + integral
                + reference.torque
                + more_torque
            )
            demand = wanted
            if wanted > 0.0:
                demand = max(min(wanted, highest, droop * (top_speed - speed)), lowest)
            elif wanted < 0.0:
                demand = min(max(wanted, lowest, -droop * (top_speed + speed)), highest)
            if growth and demand == wanted:
                integral = min(max(integral + growth * error, -windup), windup)
        self.torque, self.demand, self._integral, self._seen_velocity = actual, demand, integral, seen
        self.limited = demand != wanted
        self._heat(steps)

    def coast(self, steps: int) -> None:
        """Let the joint move on without current."""
        self.torque = self.demand = self._seen_velocity = 0.0
        self.limited = False
        for _ in range(steps):
            self.joint.coast()
        self._heat(steps)

    def _heat(self, steps: int) -> None:
        settings = self.settings
        share = self.torque / settings.rated_torque
        self.thermal.advance(share, steps * STEP_S, settings.winding_time_s, settings.housing_time_s)
