"""A joint drive on the bus: CiA 402 objects, states and modes in front of a motor that really moves."""

import math
from collections.abc import Callable
from enum import IntEnum

from eds.description import Description
from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import Clock
from hil_sim.drive.encoder import Encoder
from hil_sim.drive.mechanics import STEP_S, Joint
from hil_sim.drive.motion import Hold, Motion, Profile, RampDown, Reference, Track
from hil_sim.drive.power_state import ENERGISED, Command, PowerState, after, command_of
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Value
from hil_sim.node.nmt import NmtState
from hil_sim.node.node import Node

STEP_NS = round(STEP_S * 1e9)
_TICK_NS = 5 * STEP_NS  # the joint is where it is now at each SYNC, and at least this often

FOLLOWING_ERROR = 0x8611  # error codes of CiA 402-2 table 17 and CiA 301
UNDERVOLTAGE = 0x3220
MOTOR_TEMPERATURE = 0x4310
COMMUNICATION = 0x8100

TEMPERATURE = (0x2010, 0)
GAINS = 0x2030
ABORT_CONNECTION_OPTION = (0x6007, 0)
ERROR_CODE = (0x603F, 0)
CONTROLWORD = (0x6040, 0)
STATUSWORD = (0x6041, 0)
QUICK_STOP_OPTION = (0x605A, 0)
FAULT_REACTION_OPTION = (0x605E, 0)
MODE = (0x6060, 0)
MODE_DISPLAY = (0x6061, 0)
POSITION_DEMAND = (0x6062, 0)
POSITION_ACTUAL = (0x6064, 0)
FOLLOWING_ERROR_WINDOW = (0x6065, 0)
FOLLOWING_ERROR_TIMEOUT = (0x6066, 0)
POSITION_WINDOW = (0x6067, 0)
VELOCITY_ACTUAL = (0x606C, 0)
MAX_TORQUE = (0x6072, 0)
RATED_TORQUE = (0x6076, 0)
TORQUE_ACTUAL = (0x6077, 0)
CURRENT_ACTUAL = (0x6078, 0)
TARGET_POSITION = (0x607A, 0)
SOFTWARE_LIMITS = 0x607D
MAX_MOTOR_SPEED = (0x6080, 0)
PROFILE_VELOCITY = (0x6081, 0)
PROFILE_ACCELERATION = (0x6083, 0)
PROFILE_DECELERATION = (0x6084, 0)
QUICK_STOP_DECELERATION = (0x6085, 0)
ENCODER_RESOLUTION = 0x608F
GEAR_RATIO = 0x6091
INTERPOLATION_TIME = 0x60C2
FOLLOWING_ERROR_ACTUAL = (0x60F4, 0)


class Mode(IntEnum):
    """Modes of operation that the drive has (6060h, 6502h)."""

    PROFILE_POSITION = 1
    CYCLIC_SYNCHRONOUS_POSITION = 8


# 605Ah and 605Eh: the object with the deceleration (None: current off at once), and whether the drive then
# stays in QUICK STOP ACTIVE.
_STOP_OPTIONS = {
    0: (None, False),
    1: (PROFILE_DECELERATION, False),
    2: (QUICK_STOP_DECELERATION, False),
    5: (PROFILE_DECELERATION, True),
    6: (QUICK_STOP_DECELERATION, True),
}

# 6007h: what the drive does when communication is gone (CiA 402-2 §6.4.2; 0 does nothing).
_ABORT_CONNECTION = {1: Command.FAULT_DETECTED, 2: Command.DISABLE_VOLTAGE, 3: Command.QUICK_STOP}

# Statusword bits beside the state.
_VOLTAGE_ENABLED = 1 << 4
_REMOTE = 1 << 9
_TARGET_REACHED = 1 << 10
_LIMIT_ACTIVE = 1 << 11
_SETPOINT_ACKNOWLEDGE = 1 << 12  # in CSP: the drive follows the command value
_FOLLOWING_ERROR_BIT = 1 << 13

# Controlword bits of profile position.
_NEW_SETPOINT = 1 << 4
_CHANGE_IMMEDIATELY = 1 << 5
_RELATIVE = 1 << 6
_HALT = 1 << 8

_AMBIENT_C = 25.0
_HEATING_AT_RATED_C = 35.0  # over ambient, after a long time at rated torque
_SUPPLY_V = 48.0
_LOWEST_SUPPLY_V = 36.0
_THERMAL_TIME_S = 600.0
_TOO_HOT_C = 100.0


class JointDrive(Node):
    """One drive; `joint` is the mechanical truth behind it.

    Positions on the bus are counts at the motor; inside all is rad, s and N·m at the joint.
    What may be disturbed from outside, at any time: `fault(code)`, `encoder`, `joint` (its `slip`,
    `friction_factor` and `load`), `temperature_c` (°C, of the motor) and `supply_v` (V, of the DC link).
    """

    def __init__(
        self, clock: Clock, bus: CanBus, name: str, node_id: int, description: Description, joint: Joint
    ) -> None:
        super().__init__(clock, bus, name, node_id, description)
        self.joint = joint
        self.power_state = PowerState.NOT_READY_TO_SWITCH_ON
        self._reference = Reference(joint.position)
        self._motion: Motion = Hold()
        self._waiting_profile: Profile | None = None
        self._advanced_ns = 0
        self._controlword = 0
        self._mode = Mode.CYCLIC_SYNCHRONOUS_POSITION
        self._error_code = 0
        self.encoder = Encoder()
        self.temperature_c = _AMBIENT_C
        self.supply_v = _SUPPLY_V
        self._late_s = 0.0
        self._limited = False
        self._targeted = False  # a target has come since the drive was enabled
        self._bind()
        self._take_constants()
        clock.every(_TICK_NS, self.advance)

    # -- objects ---------------------------------------------------------------------------------------

    def _bind(self) -> None:
        sources: dict[tuple[int, int], Callable[[], Value]] = {
            STATUSWORD: self.statusword,
            ERROR_CODE: lambda: self._error_code,
            MODE_DISPLAY: lambda: int(self._mode),
            POSITION_DEMAND: lambda: round(self._reference.position * self.counts_per_radian),
            POSITION_ACTUAL: lambda: round(self._position * self.counts_per_radian),
            VELOCITY_ACTUAL: lambda: round(self.joint.velocity * self.counts_per_radian),
            FOLLOWING_ERROR_ACTUAL: lambda: round(self._following_error() * self.counts_per_radian),
            TORQUE_ACTUAL: self._torque_permille,
            CURRENT_ACTUAL: self._torque_permille,  # a motor whose torque is its current
            TEMPERATURE: lambda: round(self.temperature_c * 10.0),
        }
        for key, source in sources.items():
            self.dictionary[key].source = source
        for key, check in {
            CONTROLWORD: self._write_controlword,
            MODE: self._write_mode,
            TARGET_POSITION: self._write_target,
            QUICK_STOP_OPTION: _check_option,
            FAULT_REACTION_OPTION: _check_option,
        }.items():
            self.dictionary[key].on_write = check

    def _take_constants(self) -> None:
        number = self._number
        self._gear = number((GEAR_RATIO, 1)) / number((GEAR_RATIO, 2))
        motor_counts = number((ENCODER_RESOLUTION, 1)) / number((ENCODER_RESOLUTION, 2))
        self.counts_per_radian = motor_counts * self._gear / math.tau
        self._rated_torque = number(RATED_TORQUE) / 1000.0 * self._gear

    def _number(self, key: tuple[int, int]) -> int:
        return self.dictionary[key].number()

    def _radians(self, key: tuple[int, int]) -> float:
        return self._number(key) / self.counts_per_radian

    def _torque_permille(self) -> int:
        return round(1000.0 * self.joint.torque / self._rated_torque)

    @property
    def _position(self) -> float:
        """Where the encoder says that the joint is."""
        return self.encoder.read(self.joint.motor_position * self.counts_per_radian) / self.counts_per_radian

    def _following_error(self) -> float:
        return self._reference.position - self._position

    def statusword(self) -> int:
        word = self.power_state.value | _VOLTAGE_ENABLED | _REMOTE
        if self._limited:
            word |= _LIMIT_ACTIVE
        if self._late_s > 0.0:
            word |= _FOLLOWING_ERROR_BIT
        if self._motion.done and self.power_state in ENERGISED:
            word |= _TARGET_REACHED
        return word | (_SETPOINT_ACKNOWLEDGE if self._acknowledges() else 0)

    def _acknowledges(self) -> bool:
        if self._mode is Mode.PROFILE_POSITION:
            return bool(self._controlword & _NEW_SETPOINT) or self._waiting_profile is not None
        return self.power_state is PowerState.OPERATION_ENABLED

    # -- commands --------------------------------------------------------------------------------------

    def _write_mode(self, value: Value) -> None:
        if value not in tuple(Mode):
            raise SdoAbort(AbortCode.INVALID_VALUE)
        mode = Mode(int(value))
        if mode is not self._mode:
            self._mode = mode
            self._waiting_profile = None
            self._hold()

    def _write_controlword(self, value: Value) -> None:
        controlword, previous = int(value), self._controlword
        self._controlword = controlword
        command = command_of(controlword, previous)
        if command is not None:
            self._do(command)
        if self._mode is Mode.PROFILE_POSITION and self.power_state is PowerState.OPERATION_ENABLED:
            self._profile_position(controlword, controlword & ~previous)

    def _write_target(self, _value: Value) -> None:
        self._targeted = True

    def _do(self, command: Command) -> None:
        if command is Command.FAULT_RESET and self.power_state is PowerState.FAULT:
            self._error_code = 0
            self.emergency_over()
        if self._stays_stopping(command):
            return
        self._change(after(self.power_state, command))

    def _stays_stopping(self, command: Command) -> bool:
        """Where 605Ah stays in QUICK STOP ACTIVE there is transition 16, elsewhere 12 at standstill."""
        if self.power_state is not PowerState.QUICK_STOP_ACTIVE:
            return False
        stays = _STOP_OPTIONS[self._number(QUICK_STOP_OPTION)][1]
        return command is (Command.STANDSTILL if stays else Command.ENABLE_OPERATION)

    def _change(self, state: PowerState) -> None:
        before, self.power_state = self.power_state, state
        if state is before:
            return
        self._late_s = 0.0
        self._waiting_profile = None
        if state is PowerState.OPERATION_ENABLED:
            self._hold()
        elif state is PowerState.QUICK_STOP_ACTIVE:
            self._slow_down(QUICK_STOP_OPTION)
        elif state is PowerState.FAULT_REACTION_ACTIVE:
            self._react_to_fault(before)
        self.object_changed(STATUSWORD)

    def _react_to_fault(self, before: PowerState) -> None:
        if before in ENERGISED:
            self._slow_down(FAULT_REACTION_OPTION)
        else:
            self._do(Command.STANDSTILL)

    def _hold(self) -> None:
        """Demand the position where the joint is, so that nothing jumps."""
        self._reference.position, self._reference.velocity = self._position, 0.0
        self._motion = Hold()
        self._targeted = False

    def _slow_down(self, option: tuple[int, int]) -> None:
        deceleration, _ = _STOP_OPTIONS[self._number(option)]
        if deceleration is None:
            self._do(Command.STANDSTILL)
        else:
            self._reference.velocity = self.joint.velocity
            self._motion = RampDown(self._radians(deceleration))

    def fault(self, code: int) -> None:
        """The drive sees an error: it reacts as 605Eh says and ends in FAULT."""
        self._error_code = code
        self.emergency(code)
        self._do(Command.FAULT_DETECTED)

    # -- modes -----------------------------------------------------------------------------------------

    def _limit(self, target: float) -> float:
        low, high = self._radians((SOFTWARE_LIMITS, 1)), self._radians((SOFTWARE_LIMITS, 2))
        limited = min(max(target, low), high)
        self._limited = limited != target
        return limited

    def _profile_position(self, controlword: int, risen: int) -> None:
        """The set-point handshake (CiA 402-2 §10.3)."""
        if controlword & _HALT:
            self._motion = RampDown(self._radians(PROFILE_DECELERATION))
        elif risen & _NEW_SETPOINT and self._waiting_profile is None:
            target = self._radians(TARGET_POSITION)
            if controlword & _RELATIVE:
                target += self._reference.position
            profile = Profile(
                self._limit(target),
                self._radians(PROFILE_VELOCITY),
                self._radians(PROFILE_ACCELERATION),
                self._radians(PROFILE_DECELERATION),
            )
            if self._motion.done or controlword & _CHANGE_IMMEDIATELY:
                self._motion = profile
            else:
                self._waiting_profile = profile

    def _cyclic_position(self) -> None:
        """Each SYNC brings a target that is to be reached within the interpolation time (60C2h)."""
        period_s = self._number((INTERPOLATION_TIME, 1)) * 10.0 ** self._number((INTERPOLATION_TIME, 2))
        self._motion = Track(self._limit(self._radians(TARGET_POSITION)), period_s)

    # -- life ------------------------------------------------------------------------------------------

    def _on_reset(self) -> None:
        self._change(PowerState.NOT_READY_TO_SWITCH_ON)
        self._controlword = 0
        self._error_code = 0
        self._mode = Mode(self._number(MODE))
        self.dictionary[CONTROLWORD].value = 0
        self.dictionary[TARGET_POSITION].value = 0

    def _on_booted(self) -> None:
        self._do(Command.BOOTED)

    def _on_state(self, before: NmtState) -> None:
        if before is NmtState.OPERATIONAL and self.state in (NmtState.STOPPED, NmtState.INITIALISING):
            self._connection_aborted()

    def _on_communication_lost(self) -> None:
        self._connection_aborted()

    def _connection_aborted(self) -> None:
        command = _ABORT_CONNECTION.get(self._number(ABORT_CONNECTION_OPTION))
        if self.power_state is not PowerState.OPERATION_ENABLED or command is None:
            return
        if command is Command.FAULT_DETECTED:
            self.fault(COMMUNICATION)
        else:
            self._do(command)

    def _on_sync(self) -> None:
        self.advance()
        if (
            self._targeted
            and self._mode is Mode.CYCLIC_SYNCHRONOUS_POSITION
            and self.power_state is PowerState.OPERATION_ENABLED
            and self.state is NmtState.OPERATIONAL
        ):
            self._cyclic_position()

    # -- motion ----------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Let motor and joint move up to the clock's time."""
        steps = (self.clock.now_ns - self._advanced_ns) // STEP_NS
        if steps <= 0:
            return
        self._advanced_ns += steps * STEP_NS
        if self.supply_v < _LOWEST_SUPPLY_V and self.power_state is PowerState.OPERATION_ENABLED:
            self.fault(UNDERVOLTAGE)
        if self.power_state in ENERGISED:
            self._drive_on(steps)
        else:
            for _ in range(steps):
                self.joint.step(0.0, math.inf)
        self._heat(steps * STEP_S)

    def _drive_on(self, steps: int) -> None:
        """Position control with velocity feed-forward; its torque is limited by 6072h, its speed by 6080h."""
        stiffness, damping = self._number((GAINS, 1)), self._number((GAINS, 2))
        max_torque = self._number(MAX_TORQUE) / 1000.0 * self._rated_torque
        max_velocity = self._number(MAX_MOTOR_SPEED) * math.tau / 60.0 / self._gear
        reference, joint = self._reference, self.joint
        for _ in range(steps):
            self._motion.step(reference, STEP_S)
            torque = stiffness * (reference.position - self._position)
            torque += damping * (reference.velocity - joint.velocity)
            joint.step(min(max(torque, -max_torque), max_torque), max_velocity)
        self._watch(steps * STEP_S)

    def _watch(self, elapsed_s: float) -> None:
        if self._motion.done:
            self._arrived()
        window = self._radians(FOLLOWING_ERROR_WINDOW)
        late = abs(self._following_error()) > window and self.power_state is PowerState.OPERATION_ENABLED
        self._late_s = self._late_s + elapsed_s if late else 0.0
        if self._late_s * 1000.0 > self._number(FOLLOWING_ERROR_TIMEOUT):
            self.fault(FOLLOWING_ERROR)

    def _arrived(self) -> None:
        if self.power_state in (PowerState.QUICK_STOP_ACTIVE, PowerState.FAULT_REACTION_ACTIVE):
            self._do(Command.STANDSTILL)
        elif self._waiting_profile is not None:
            self._motion, self._waiting_profile = self._waiting_profile, None

    def _heat(self, elapsed_s: float) -> None:
        share = self.joint.torque / self._rated_torque
        end_c = _AMBIENT_C + _HEATING_AT_RATED_C * share * share
        self.temperature_c += (end_c - self.temperature_c) * elapsed_s / _THERMAL_TIME_S
        if self.temperature_c > _TOO_HOT_C and self._error_code == 0:
            self.fault(MOTOR_TEMPERATURE)


def _check_option(value: Value) -> None:
    if value not in _STOP_OPTIONS:
        raise SdoAbort(AbortCode.INVALID_VALUE)
