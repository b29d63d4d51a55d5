"""The gait controller: bus master of the exoskeleton, and the one whom a stop has to win against.

It starts the nodes, sends SYNC, brings the drives up one transition at a time, and then commands position and
"enable operation" to every drive in every cycle. When a drive leaves operation by anyone else's hand, it
stops commanding all of them and waits for its start object.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from eds.description import Description
from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import MILLISECOND_NS, Clock, Repeating
from hil_sim.drive.power_state import PowerState
from hil_sim.gait.activity import Activity
from hil_sim.gait.generator import Generator
from hil_sim.gait.profiles import smooth
from hil_sim.gait.walk import Shape
from hil_sim.node.dictionary import Value
from hil_sim.node.nmt import NMT_COB_ID, NmtService, NmtState
from hil_sim.node.node import SYNC, Node

COMMAND = (0x2000, 0)
STEP_LENGTH = (0x2001, 0)
CYCLE_TIME = (0x2002, 0)
TOE_HEIGHT = (0x2003, 0)
TRUNK_ANGLE = (0x2004, 0)
ACTIVITY = (0x2005, 0)
STATE = (0x2010, 0)
PHASE = (0x2011, 0)
HOLDER = (0x2012, 0)
CONTROLWORDS, MODES, TARGETS = 0x2110, 0x2111, 0x2112
STATUSWORDS, POSITIONS = 0x2120, 0x2121
CYCLE_PERIOD = (0x1006, 0)

STOPPED_BY_COMMAND = 255

_SYNC_PRODUCER = 1 << 30
_CYCLIC_SYNCHRONOUS_POSITION = 8
_ENABLE_OPERATION = 0x0F
_QUICK_STOP = 0x02
_SILENCE_NS = 100 * MILLISECOND_NS  # a drive that shows no statusword for so long has left
_ENABLING_NS = 5000 * MILLISECOND_NS
_TAKE_OVER_S = 1.0  # how long the way from where the joints are to the motion takes


class ControllerState(IntEnum):
    """What object 2010h shows."""

    IDLE = 0  # not booted
    STARTING = 1  # waits for the statusword of every drive
    ENABLING = 2  # brings the drives up
    RUNNING = 3
    HELD = 4  # quick stop to all until the start object is written


_COMMANDING = (ControllerState.STARTING, ControllerState.ENABLING, ControllerState.RUNNING)

# The next controlword on the way up; each is sent only after the statusword has shown the state.
_WAY_UP = {
    PowerState.FAULT: 0x80,
    PowerState.QUICK_STOP_ACTIVE: 0x00,
    PowerState.SWITCH_ON_DISABLED: 0x06,
    PowerState.READY_TO_SWITCH_ON: 0x07,
    PowerState.SWITCHED_ON: _ENABLE_OPERATION,
    PowerState.OPERATION_ENABLED: _ENABLE_OPERATION,
}
# Statusword masks of CiA 402-2 table 6: bit 5 says nothing in the first four states.
_MASKED_BY_4F = {
    state.value & 0x4F: state
    for state in (
        PowerState.NOT_READY_TO_SWITCH_ON,
        PowerState.SWITCH_ON_DISABLED,
        PowerState.FAULT_REACTION_ACTIVE,
        PowerState.FAULT,
    )
}
_MASKED_BY_6F = {
    state.value: state
    for state in (
        PowerState.READY_TO_SWITCH_ON,
        PowerState.SWITCHED_ON,
        PowerState.OPERATION_ENABLED,
        PowerState.QUICK_STOP_ACTIVE,
    )
}


def power_state_of(statusword: int) -> PowerState | None:
    """The drive's state in its statusword, `None` for bits that no state has."""
    return _MASKED_BY_6F.get(statusword & 0x6F) or _MASKED_BY_4F.get(statusword & 0x4F)


@dataclass(slots=True)
class _Seen:
    """What is known about one drive from its PDO."""

    state: PowerState | None = None
    stamp_ns: int = 0


class GaitController(Node):
    """Node that runs the gait; `joints` are the node ids of the drives in the order of its sub-indices.

    `counts_per_radian` holds for every drive.
    """

    def __init__(
        self,
        clock: Clock,
        bus: CanBus,
        name: str,
        node_id: int,
        description: Description,
        joints: tuple[int, ...],
        counts_per_radian: float,
    ) -> None:
        super().__init__(clock, bus, name, node_id, description)
        self.controller_state = ControllerState.IDLE
        self._joints = joints
        self._counts_per_radian = counts_per_radian
        self._seen = [_Seen() for _ in joints]
        self._holder = 0
        self._since_ns = 0
        self._offsets = [0.0] * len(joints)
        self._taken_over_s = 0.0
        self._sync_timer: Repeating | None = None
        self.generator = Generator(self._shape())
        self._bind()

    def _bind(self) -> None:
        dictionary = self.dictionary
        dictionary[STATE].source = lambda: int(self.controller_state)
        dictionary[PHASE].source = lambda: int(self.generator.phase * 1000.0)
        dictionary[HOLDER].source = lambda: self._holder
        dictionary[COMMAND].source = lambda: int(self.controller_state in _COMMANDING)
        dictionary[COMMAND].on_write = self._command
        dictionary[CYCLE_PERIOD].on_write = lambda period_us: self._start_sync(int(period_us))
        for number, seen in enumerate(self._seen, 1):
            dictionary[STATUSWORDS, number].on_write = self._statusword_taker(seen)

    def _statusword_taker(self, seen: _Seen) -> Callable[[Value], None]:
        def take(statusword: Value) -> None:
            seen.state = power_state_of(int(statusword))
            seen.stamp_ns = self.clock.now_ns

        return take

    def _shape(self) -> Shape:
        """The gait's shape as the objects say, in SI."""
        raw = [
            self.dictionary[key].number() / 1000.0
            for key in (STEP_LENGTH, CYCLE_TIME, TOE_HEIGHT, TRUNK_ANGLE)
        ]
        return Shape(*raw)

    # -- life ------------------------------------------------------------------------------------------

    def _on_reset(self) -> None:
        self.controller_state = ControllerState.IDLE
        self._holder = 0
        self._stop_sync()
        self.generator.reset(self._shape())

    def _on_booted(self) -> None:
        self.send(NMT_COB_ID, bytes([NmtService.START, 0]))
        self._enter(NmtState.OPERATIONAL)
        self._start_sync(self.dictionary[CYCLE_PERIOD].number())
        self._go(ControllerState.STARTING)

    def _on_heartbeat(self, node_id: int, state: int) -> None:
        if node_id in self._joints and state == NmtState.INITIALISING:
            self._seen[self._joints.index(node_id)].state = None
            self.send(NMT_COB_ID, bytes([NmtService.START, node_id]))

    def _start_sync(self, period_us: int) -> None:
        self._stop_sync()
        if self.dictionary[SYNC].number() & _SYNC_PRODUCER and period_us:
            self._sync_timer = self.clock.every(period_us * 1000, self._cycle)

    def _stop_sync(self) -> None:
        if self._sync_timer is not None:
            self._sync_timer.cancel()
            self._sync_timer = None

    def _cycle(self) -> None:
        if self.state is not NmtState.STOPPED:
            self.send(self.dictionary[SYNC].number() & 0x7FF, b"")
            self.synchronise()

    # -- the controller's own states -----------------------------------------------------------------------

    def _command(self, value: Value) -> None:
        if not value:
            self._hold(STOPPED_BY_COMMAND)
        elif self.controller_state is ControllerState.HELD:
            self._go(ControllerState.STARTING)

    def _go(self, state: ControllerState) -> None:
        self.controller_state = state
        self._since_ns = self.clock.now_ns
        if state is not ControllerState.HELD:
            self._holder = 0

    def _hold(self, holder: int) -> None:
        if self.controller_state is not ControllerState.HELD:
            self._go(ControllerState.HELD)
            self._holder = holder

    def _present(self, seen: _Seen) -> bool:
        return seen.state is not None and self.clock.now_ns - seen.stamp_ns <= _SILENCE_NS

    def _first(self, wrong: Callable[[_Seen], bool]) -> int | None:
        """The node id of the first drive that is `wrong`."""
        return next((node for node, seen in zip(self._joints, self._seen, strict=True) if wrong(seen)), None)

    def _on_sync(self) -> None:
        state = self.controller_state
        if state is ControllerState.STARTING:
            self._starting()
        elif state is ControllerState.ENABLING:
            self._enabling()
        elif state is ControllerState.RUNNING:
            self._running()
        elif state is ControllerState.HELD:
            self._settle()
        if self.controller_state is not ControllerState.RUNNING:
            self._command_where_they_are()

    def _starting(self) -> None:
        if self._first(lambda seen: not self._present(seen)) is None:
            self._go(ControllerState.ENABLING)

    def _enabling(self) -> None:
        waits_for = self._first(lambda seen: seen.state is not PowerState.OPERATION_ENABLED)
        if waits_for is None:
            self._take_over()
        elif self.clock.now_ns - self._since_ns > _ENABLING_NS:
            self._hold(waits_for)

    def _running(self) -> None:
        left = self._first(
            lambda seen: seen.state is not PowerState.OPERATION_ENABLED or not self._present(seen)
        )
        if left is None:
            self._move()
        else:
            self._hold(left)

    # -- motion ------------------------------------------------------------------------------------------

    def _take_over(self) -> None:
        """Begin the motion where the joints are: what they differ from it fades out."""
        self._go(ControllerState.RUNNING)
        actual = [self.dictionary[POSITIONS, number].number() for number in range(1, len(self._joints) + 1)]
        wanted = self._angles()
        self._offsets = [a / self._counts_per_radian - w for a, w in zip(actual, wanted, strict=True)]
        self._taken_over_s = 0.0
        self._move()

    def _settle(self) -> None:
        """Nobody walks on with drives that have stopped: the wearer comes to stand, or stays on the seat."""
        self.generator.step(self._period_s(), self.generator.at_rest, self._shape())

    def _period_s(self) -> float:
        return self.dictionary[CYCLE_PERIOD].number() / 1e6

    def _angles(self) -> list[float]:
        left, right = self.generator.legs()
        return [*left, *right]

    def _move(self) -> None:
        dt = self._period_s()
        self._taken_over_s = min(self._taken_over_s + dt, _TAKE_OVER_S)
        self.generator.step(dt, Activity(self.dictionary[ACTIVITY].number()), self._shape())
        left = 1.0 - smooth(self._taken_over_s / _TAKE_OVER_S)
        for number, (angle, offset) in enumerate(zip(self._angles(), self._offsets, strict=True), 1):
            self._set(number, _ENABLE_OPERATION, round((angle + left * offset) * self._counts_per_radian))

    def _command_where_they_are(self) -> None:
        """A drive that moves when nobody leads it is slowed down; only ENABLING brings one up."""
        enabling = self.controller_state is ControllerState.ENABLING
        for number, seen in enumerate(self._seen, 1):
            up = enabling and seen.state in _WAY_UP
            controlword = _WAY_UP[seen.state] if up and seen.state is not None else _QUICK_STOP
            self._set(number, controlword, self.dictionary[POSITIONS, number].number())

    def _set(self, number: int, controlword: int, target: int) -> None:
        self.dictionary[CONTROLWORDS, number].value = controlword
        self.dictionary[MODES, number].value = _CYCLIC_SYNCHRONOUS_POSITION
        self.dictionary[TARGETS, number].value = target
