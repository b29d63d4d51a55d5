"""The power drive system: goes from state to state, and brings the motor to rest on the way out."""

from collections.abc import Callable

from hil_sim.drive import objects as od
from hil_sim.drive import options
from hil_sim.drive.objects import Objects
from hil_sim.drive.options import Ramp
from hil_sim.drive.power_state import ENABLING, ENERGISED, Command, PowerState, after
from hil_sim.drive.servo import Servo
from hil_sim.drive.supervision import CURRENT_GONE

# A stop that takes so much longer than its ramp is given up: the current goes.
_STOP_PATIENCE_S = 1.0


class Power:
    """The state, and what the option codes make of leaving it; `changed` is called with the state before.

    `can_recover` is asked before a fault is reset.
    """

    def __init__(
        self,
        servo: Servo,
        objects: Objects,
        changed: Callable[[PowerState], None],
        can_recover: Callable[[], bool],
    ) -> None:
        self.state = PowerState.NOT_READY_TO_SWITCH_ON
        self.error_code = 0
        self.torque_off = False  # STO (IEC 61800-5-2): hardware keeps the motor without power
        self._servo = servo
        self._objects = objects
        self._changed = changed
        self._can_recover = can_recover
        self._way_out: Command | None = None
        self._overdue_s = 0.0

    @property
    def enabled(self) -> bool:
        return self.state is PowerState.OPERATION_ENABLED

    @property
    def follows(self) -> bool:
        """The drive follows set-points: it is enabled, and not on its way out."""
        return self.state is PowerState.OPERATION_ENABLED and self._way_out is None

    @property
    def energised(self) -> bool:
        return self.state in ENERGISED

    @property
    def faulty(self) -> bool:
        return self.state in (PowerState.FAULT_REACTION_ACTIVE, PowerState.FAULT)

    def restart(self) -> None:
        self.error_code = 0
        self._change(PowerState.NOT_READY_TO_SWITCH_ON)

    def fault(self, code: int) -> None:
        self.error_code = code
        self.do(Command.FAULT_DETECTED)

    def take_torque(self, *, off: bool) -> None:
        """Hardware takes the motor's power, whatever it is doing, or allows it again."""
        self.torque_off = off
        if off:
            self.do(Command.STANDSTILL if self.faulty else Command.DISABLE_VOLTAGE)

    def do(self, command: Command) -> None:
        """Carry out what the table allows, now or once the motor stands."""
        if self.torque_off and command in ENABLING:
            return
        if command is Command.ENABLE_OPERATION and self.follows:
            return  # as a master says again and again
        if command is Command.FAULT_RESET and not self._can_recover():
            return
        if self._stays_stopping(command) or self._goes_out_slowly(command):
            return
        self._change(after(self.state, command))

    def _stays_stopping(self, command: Command) -> bool:
        """Return whether 605Ah bars this transition: 12 if it stays in QUICK STOP ACTIVE, else 16."""
        if self.state is not PowerState.QUICK_STOP_ACTIVE:
            return False
        impossible = Command.STANDSTILL if options.stays(self._objects) else Command.ENABLE_OPERATION
        return command is impossible

    def _goes_out_slowly(self, command: Command) -> bool:
        """605Bh, 605Ch: transitions 5 and 8 come at standstill; until then "enable operation" undoes them."""
        if not self.enabled:
            return False
        if command is Command.ENABLE_OPERATION and self._way_out is not None:
            self._way_out = None
            self._changed(self.state)
        option = options.WAYS_OUT.get(command)
        ramp = Ramp.OFF if option is None else options.ramp(self._objects, option)
        if ramp is Ramp.OFF:
            return False
        if self._way_out is None:
            self._slow_down(ramp)
        self._way_out = command
        return True

    def _change(self, state: PowerState) -> None:
        before, self.state = self.state, state
        if state is before:
            return
        self._way_out = None
        if state is PowerState.QUICK_STOP_ACTIVE:
            self._stop(options.ramp(self._objects, od.QUICK_STOP_OPTION))
        elif state is PowerState.FAULT_REACTION_ACTIVE:
            possible = before in ENERGISED and self.error_code not in CURRENT_GONE
            self._stop(options.ramp(self._objects, od.FAULT_REACTION_OPTION) if possible else Ramp.OFF)
        elif state is PowerState.SWITCH_ON_DISABLED:
            self.error_code = 0
        self._changed(before)

    def _stop(self, ramp: Ramp) -> None:
        if ramp is Ramp.OFF:
            self.do(Command.STANDSTILL)
        else:
            self._slow_down(ramp)

    def _slow_down(self, ramp: Ramp) -> None:
        self._servo.stop(ramp)
        self._overdue_s = 0.0

    def stopping(self, elapsed_s: float) -> None:
        """Advance the slowing motor by `elapsed_s`, and check whether it stands."""
        if self._servo.motion.done:
            self._overdue_s += elapsed_s
        if self._servo.at_rest or self._overdue_s > _STOP_PATIENCE_S:
            if self._way_out is None:
                self.do(Command.STANDSTILL)
            else:
                self._change(after(self.state, self._way_out))
