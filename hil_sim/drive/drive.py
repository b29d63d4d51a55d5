"""A joint drive on the bus: CiA 402 objects, states and modes in front of a motor that really moves."""

from collections.abc import Callable

from eds.description import Description
from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import Clock
from hil_sim.drive import objects as od
from hil_sim.drive import options, supervision
from hil_sim.drive.mechanics import STEP_S, Joint
from hil_sim.drive.modes import MODES
from hil_sim.drive.modes.homing import NO_METHOD
from hil_sim.drive.modes.mode import BIT_13, TARGET_REACHED, Mode, ModeNumber
from hil_sim.drive.modes.searching import METHODS
from hil_sim.drive.objects import Objects
from hil_sim.drive.options import Ramp
from hil_sim.drive.power import Power
from hil_sim.drive.power_state import ENABLING, LIVE, Command, PowerState, command_of
from hil_sim.drive.servo import Servo
from hil_sim.drive.settings import Parameters
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Key, Value
from hil_sim.node.nmt import NmtState
from hil_sim.node.node import Node

STEP_NS = round(STEP_S * 1e9)
_TICK_NS = 5 * STEP_NS  # the joint is where it is now at each SYNC, and at least this often

# Statusword bits beside the state and the mode's own.
_VOLTAGE_ENABLED = 1 << 4
_WARNING = 1 << 7
_REMOTE = 1 << 9
_LIMIT_ACTIVE = 1 << 11
_CURRENT_REDUCED = 1 << 14  # the manufacturer's: I²t leaves less than the peak current
_HOMED = 1 << 15  # the manufacturer's

# Bits of 60FDh.
_LOW_SWITCH, _HIGH_SWITCH, _HOME_SWITCH = 1 << 0, 1 << 1, 1 << 2
_TORQUE_OFF = 1 << 16  # the manufacturer's

_NO_MODE_CHANGE = 0  # of 6060h
_FIRST_MODE = ModeNumber.CYCLIC_SYNCHRONOUS_POSITION  # where 6060h says none


class JointDrive(Node):
    """One drive; `joint` is the mechanical truth behind it.

    Positions on the bus are counts at the motor; inside all is rad, s and N·m at the joint.
    What may be disturbed from outside, at any time: `fault(code)`, `encoder`, `joint` (its `slip`,
    `friction_factor`, `creep` and `load`), `temperature_c` (°C, of the motor), `supply_v` (V, of the DC
    link), `inputs` (bits of 60FDh that are set from outside) and `power.take_torque` (STO).
    """

    def __init__(
        self, clock: Clock, bus: CanBus, name: str, node_id: int, description: Description, joint: Joint
    ) -> None:
        super().__init__(clock, bus, name, node_id, description)
        self.joint = joint
        self.objects = Objects(self.dictionary)
        self.supply_v = supervision.NOMINAL_SUPPLY_V
        self.inputs = 0
        self._bind_commands()
        self._parameters = Parameters(self.objects)
        self.servo = Servo(joint, self._parameters)
        self.encoder = self.servo.encoder
        self.power = Power(self.servo, self.objects, self._power_changed, self._may_recover)
        self._modes = {number: mode(self.servo, self.objects) for number, mode in MODES.items()}
        self._choose_mode(_FIRST_MODE)
        self._following = supervision.FollowingErrorWatch()
        self._advanced_ns = 0
        self._controlword = 0
        self._shown: int | None = None  # the statusword, where somebody wants to know of its changes
        self._bind_values()
        clock.every(_TICK_NS, self.advance)

    @property
    def power_state(self) -> PowerState:
        return self.power.state

    @property
    def counts_per_radian(self) -> float:
        return self._parameters.now.counts_per_radian

    @property
    def temperature_c(self) -> float:
        """Temperature of the motor's housing; the winding is warmer by what its current makes of it."""
        return self.servo.thermal.housing_c

    @temperature_c.setter
    def temperature_c(self, celsius: float) -> None:
        self.servo.thermal.housing_c = celsius

    # -- objects ---------------------------------------------------------------------------------------

    def _bind_commands(self) -> None:
        checks: dict[Key, Callable[[Value], None]] = {
            od.CONTROLWORD: self._write_controlword,
            od.MODE: self._write_mode,
            od.HOMING_METHOD: self._check_homing_method,
            **{key: self._target_taker(key) for key in _TARGETS if self.objects.has(key)},
            **{key: _option_check(allowed) for key, allowed in options.ALLOWED.items()},
        }
        for key, check in checks.items():
            if self.objects.has(key):
                self.dictionary[key].on_write = check

    def _bind_values(self) -> None:
        servo = self.servo
        sources: dict[Key, Callable[[], Value]] = {
            od.STATUSWORD: self.statusword,
            od.ERROR_CODE: lambda: self.power.error_code,
            od.MODE_DISPLAY: lambda: int(self._mode_number),
            od.POSITION_DEMAND: lambda: self._counts(servo.reference.position),
            od.POSITION_ACTUAL: lambda: self._counts(servo.position),
            od.VELOCITY_DEMAND: lambda: self._counts(servo.reference.velocity),
            od.VELOCITY_ACTUAL: lambda: self._counts(servo.velocity),
            od.FOLLOWING_ERROR_ACTUAL: lambda: self._counts(servo.following_error),
            od.TORQUE_DEMAND: lambda: self._permille(servo.demand),
            od.TORQUE_ACTUAL: lambda: self._permille(servo.torque),
            od.CURRENT_ACTUAL: lambda: self._permille(servo.torque),  # a motor whose torque is its current
            od.DC_LINK_VOLTAGE: lambda: round(self.supply_v * 1000.0),
            od.DIGITAL_INPUTS: self._digital_inputs,
            od.MOTOR_TEMPERATURE: lambda: round(servo.thermal.housing_c * 10.0),
            od.WINDING_TEMPERATURE: lambda: round(servo.thermal.winding_c * 10.0),
            od.MOTOR_LOAD: lambda: round(servo.thermal.load * 1000.0),
        }
        for key, source in sources.items():
            if self.objects.has(key):
                self.dictionary[key].source = source

    def _counts(self, radians: float) -> int:
        return round(radians * self._parameters.now.counts_per_radian)

    def _permille(self, torque: float) -> int:
        return round(1000.0 * torque / self._parameters.now.rated_torque)

    def _digital_inputs(self) -> int:
        switches = _LOW_SWITCH * self.joint.at_low_switch | _HIGH_SWITCH * self.joint.at_high_switch
        switches |= _HOME_SWITCH * self.joint.at_home_switch
        return switches | _TORQUE_OFF * self.power.torque_off | self.inputs

    def statusword(self) -> int:
        servo, state = self.servo, self.power.state
        word: int = state.value | _REMOTE
        supplied = self.supply_v >= supervision.LOWEST_SUPPLY_V and not self.power.torque_off
        word |= _VOLTAGE_ENABLED * supplied
        word |= _WARNING * supervision.warning(servo, self.supply_v) | _LIMIT_ACTIVE * servo.limited
        word |= _CURRENT_REDUCED * servo.thermal.reduced | _HOMED * servo.homed
        if state is PowerState.OPERATION_ENABLED:
            mode, late = self._mode, self._following.late_s > 0.0
            return word | mode.status() | BIT_13 * late | _LIMIT_ACTIVE * mode.clipped
        return word | TARGET_REACHED * (self.power.energised and servo.at_rest)

    # -- commands --------------------------------------------------------------------------------------

    def _write_mode(self, value: Value) -> None:
        if value in (_NO_MODE_CHANGE, self._mode_number):
            return
        if not self._offers(int(value)):
            raise SdoAbort(AbortCode.INVALID_VALUE)
        self._choose_mode(int(value))
        self._following.late_s = 0.0
        if self.power.follows:
            self.servo.stop(Ramp.SLOW_DOWN)
            self._mode.enter()

    def _choose_mode(self, number: int) -> None:
        self._mode_number = ModeNumber(number)
        self._mode: Mode = self._modes[self._mode_number]

    def _offers(self, mode: int) -> bool:
        return mode in tuple(ModeNumber) and bool(self.objects.positive(od.SUPPORTED_MODES) >> mode - 1 & 1)

    def _write_controlword(self, value: Value) -> None:
        controlword, previous = int(value), self._controlword
        self._controlword = controlword
        command = command_of(controlword, previous)
        if command is not None:
            self.power.do(command)
        if self.power.follows:
            self._mode.command(controlword, controlword & ~previous)

    def _check_homing_method(self, value: Value) -> None:
        if value != NO_METHOD and value not in (self.objects.homing_methods() or METHODS):
            raise SdoAbort(AbortCode.INVALID_VALUE)

    def _target_taker(self, key: Key) -> Callable[[Value], None]:
        entry = self.dictionary[key]

        def written(value: Value) -> None:
            if self.power.follows:
                self._mode.target_written(key, value != entry.value)

        return written

    def _power_changed(self, before: PowerState) -> None:
        self._following.late_s = 0.0
        if before is PowerState.FAULT:
            self.emergency_over()
        if self.power.enabled:
            if before is not PowerState.OPERATION_ENABLED:
                self.servo.hold()
            self._mode.enter()
        self._show_changes()

    def fault(self, code: int) -> None:
        """Raise an error in a powered drive: it reacts by 605Eh and ends in FAULT."""
        if not self.powered:
            return
        self.emergency(code)
        self.power.fault(code)

    def _may_recover(self) -> bool:
        """Return whether every error is over, so that it can be reset."""
        return supervision.trouble(self.servo, self.supply_v, live=True) is None

    # -- life ------------------------------------------------------------------------------------------

    def _on_reset(self) -> None:
        self._parameters.reset()
        self.power.restart()
        self.servo.forget_home()
        self._controlword = 0
        mode = self.objects.number(od.MODE)
        self._choose_mode(mode if self._offers(mode) else _FIRST_MODE)
        for key in (od.CONTROLWORD, *_TARGETS):
            if self.objects.has(key):
                self.dictionary[key].value = 0

    def _on_booted(self) -> None:
        self.power.do(Command.BOOTED)

    def _on_state(self, before: NmtState) -> None:
        if before is NmtState.OPERATIONAL and self.state in (NmtState.STOPPED, NmtState.INITIALISING):
            self._connection_aborted()

    def _on_communication_lost(self) -> None:
        self._connection_aborted()

    def _connection_aborted(self) -> None:
        command = options.ABORT_CONNECTION.get(self.objects.number(od.ABORT_CONNECTION_OPTION))
        if not self.power.enabled or command is None:
            return
        if command is Command.FAULT_DETECTED:
            self.fault(supervision.COMMUNICATION)
        else:
            self.power.do(command)

    def lead(self, target: int) -> None:
        """Follow a position (counts) that comes by no bus; a motor that is off is switched on."""
        if not self.power.follows:
            for command in (Command.BOOTED, *ENABLING):
                self.power.do(command)
        self.dictionary[od.TARGET_POSITION].take(target)
        self.advance()
        if self.power.follows:
            self._mode.synchronise()

    def _on_sync(self) -> None:
        self.advance()
        if self.power.follows and self.state is NmtState.OPERATIONAL:
            self._mode.synchronise()

    # -- motion ----------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Let motor and joint move up to the clock's time."""
        steps = (self.clock.now_ns - self._advanced_ns) // STEP_NS
        if steps <= 0:
            return
        self._advanced_ns += steps * STEP_NS
        elapsed_s = steps * STEP_S
        if not self.power.energised:
            self.servo.coast(steps)
        else:
            self.servo.run(steps, self.supply_v)
            if self.power.follows:
                self._mode.update(elapsed_s)
            else:
                self.power.stopping(elapsed_s)
        self._supervise(elapsed_s)
        self._show_changes()

    def _supervise(self, elapsed_s: float) -> None:
        error = supervision.trouble(self.servo, self.supply_v, self.power.state in LIVE)
        watched = self.power.enabled and self._mode.follows_position
        if self._following.update(self.servo, watched, elapsed_s):
            error = error or supervision.FOLLOWING_ERROR
        if error is not None and not self.power.faulty:
            self.fault(error)

    def _show_changes(self) -> None:
        if not self.watched(od.STATUSWORD):
            self._shown = None
            return
        before, self._shown = self._shown, self.statusword()
        if before not in (None, self._shown):
            self.object_changed(od.STATUSWORD)


_TARGETS = (od.TARGET_POSITION, od.TARGET_VELOCITY, od.TARGET_TORQUE)


def _option_check(allowed: tuple[int, ...]) -> Callable[[Value], None]:
    def check(value: Value) -> None:
        if value not in allowed:
            raise SdoAbort(AbortCode.INVALID_VALUE)

    return check
