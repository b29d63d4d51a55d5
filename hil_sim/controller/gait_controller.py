"""The gait controller: bus master of the exoskeleton, and the one whom a stop has to win against.

It starts the nodes, sends SYNC, brings the drives up one transition at a time, and then commands position and
"enable operation" to every drive in every cycle. When a drive leaves operation by anyone else's hand, or a
heartbeat goes missing, it stops commanding all of them and waits for its start object.
"""

import random
from collections.abc import Collection, Iterable
from functools import partial

from eds.description import Description
from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import MILLISECOND_NS, Clock
from hil_sim.controller import objects
from hil_sim.controller.commissioning import SDO_RESPONSE, Commissioning
from hil_sim.controller.drives import ENABLE_OPERATION, QUICK_STOP, DriveStatus, first
from hil_sim.controller.objects import COMMANDING, ControllerState
from hil_sim.gait.activity import Activity
from hil_sim.gait.generator import Generator
from hil_sim.gait.profiles import smooth
from hil_sim.gait.subject import NOMINAL, WearerSettings
from hil_sim.gait.walk import Shape
from hil_sim.mounting import Mounting
from hil_sim.node.dictionary import Value
from hil_sim.node.nmt import NMT_COB_ID, NmtService, NmtState
from hil_sim.node.node import Handler, Node
from hil_sim.node.sync import CYCLE_PERIOD

_CYCLIC_SYNCHRONOUS_POSITION = 8
_ENABLING_NS = 5000 * MILLISECOND_NS
_TAKE_OVER_S = 1.0  # how long the way from where the joints are to the motion takes


class GaitController(Node):
    """Node that runs the gait; `joints` are the mountings of the drives in the order of its sub-indices.

    Those in `absent`, by their places in it, are not there: no PDO or SDO ever goes to them.
    `counts_per_radian` holds for every drive; those that are `foreign` are set up before they are started.
    The motion is that of `wearer`; its strides vary by `source`.
    """

    def __init__(
        self,
        clock: Clock,
        bus: CanBus,
        name: str,
        node_id: int,
        description: Description,
        joints: tuple[Mounting, ...],
        counts_per_radian: float,
        wearer: WearerSettings = NOMINAL,
        source: random.Random | None = None,
        foreign: Collection[int] = (),
        absent: Collection[int] = (),
    ) -> None:
        super().__init__(clock, bus, name, node_id, description)
        self.controller_state = ControllerState.IDLE
        self._counts_per_radian = counts_per_radian
        self._joints = joints
        self._led = [place for place in range(len(joints)) if place not in absent]
        self._drives = [DriveStatus(joints[place].node_id, clock) for place in self._led]
        objects.listen_to(
            self.dictionary,
            [None if place in absent else joint.node_id for place, joint in enumerate(joints)],
        )
        self._commissionings = {
            node: Commissioning(clock, self.send, node, partial(self._start_node, node)) for node in foreign
        }
        self._commands = [
            [
                self.dictionary[index, number]
                for index in (objects.CONTROLWORDS, objects.MODES, objects.TARGETS)
            ]
            for number in range(1, len(joints) + 1)
        ]
        self.strays = [0.0] * len(joints)  # rad, by which a fault makes each set-point wrong
        self._holder = 0
        self._since_ns = 0
        self._offsets = [0.0] * len(joints)
        self._taken_over_s = 0.0
        self.generator = Generator(self._shape(), wearer, source)
        self._bind()

    def _bind(self) -> None:
        dictionary = self.dictionary
        dictionary[objects.STATE].source = lambda: int(self.controller_state)
        dictionary[objects.PHASE].source = lambda: int(self.generator.phase * 1000.0)
        dictionary[objects.HOLDER].source = lambda: self._holder
        dictionary[objects.COMMAND].source = lambda: int(self.controller_state in COMMANDING)
        dictionary[objects.COMMAND].on_write = self._command
        for place, seen in zip(self._led, self._drives, strict=True):
            dictionary[objects.STATUSWORDS, place + 1].on_write = seen.take

    def go(self, activity: Activity, pace: tuple[float, float] | None = None) -> None:
        """Want an activity from now on, as a client who writes 2005h; `pace`: step length (m), cycle (s).

        Raises `hil_sim.node.abort.SdoAbort` where the objects' limits forbid it.
        """
        if pace is not None:
            for key, value in zip((objects.STEP_LENGTH, objects.CYCLE_TIME), pace, strict=True):
                self.dictionary.write(*key, round(value * 1000.0).to_bytes(2, "little"))
        self.dictionary.write(*objects.ACTIVITY, bytes([activity]))

    def _shape(self) -> Shape:
        """Return the gait's shape as the objects say, in SI."""
        keys = (objects.STEP_LENGTH, objects.CYCLE_TIME, objects.TOE_HEIGHT, objects.TRUNK_ANGLE)
        return Shape(*(self.dictionary[key].number() / 1000.0 for key in keys))

    # -- life ------------------------------------------------------------------------------------------

    def _on_reset(self) -> None:
        self.controller_state = ControllerState.IDLE
        self._holder = 0
        self.generator.reset(self._shape())

    def _on_booted(self) -> None:
        self._start_nodes()
        self._enter(NmtState.OPERATIONAL)
        self._go(ControllerState.STARTING)

    def _on_heartbeat(self, node_id: int, state: int) -> None:
        seen = next((seen for seen in self._drives if seen.node_id == node_id), None)
        if seen is None or state == NmtState.OPERATIONAL:
            return
        if self.controller_state is ControllerState.RUNNING:
            self._hold(node_id)
        if state == NmtState.INITIALISING:
            seen.state = None
            self._bring_up(node_id)

    def _own_handlers(self) -> Iterable[tuple[int, Handler]]:
        return [(SDO_RESPONSE + node, one.answered) for node, one in self._commissionings.items()]

    def _start_nodes(self) -> None:
        if not self._commissionings:
            self._start_node(0)  # all at once
        else:
            for seen in self._drives:
                self._bring_up(seen.node_id)

    def _bring_up(self, node_id: int) -> None:
        if node_id in self._commissionings:
            self._commissionings[node_id].begin(self.dictionary.number(CYCLE_PERIOD) // 1000)
        else:
            self._start_node(node_id)

    def _start_node(self, node_id: int) -> None:
        self.send(NMT_COB_ID, bytes([NmtService.START, node_id]))

    def _heartbeat_lost(self, node_id: int) -> None:
        super()._heartbeat_lost(node_id)
        if self.controller_state in COMMANDING:
            self._hold(node_id)

    # -- the controller's own states -----------------------------------------------------------------------

    def _command(self, value: Value) -> None:
        if not value:
            self._hold(objects.STOPPED_BY_COMMAND)
        elif self.controller_state is ControllerState.HELD:
            self.emergency_over()
            self.send(NMT_COB_ID, bytes([NmtService.START, 0]))
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
        if all(seen.present for seen in self._drives):
            self._go(ControllerState.ENABLING)

    def _enabling(self) -> None:
        waits_for = first(self._drives, lambda seen: not seen.enabled)
        if waits_for is None:
            self._take_over()
        elif self.clock.now_ns - self._since_ns > _ENABLING_NS:
            self._hold(waits_for)

    def _running(self) -> None:
        left = first(self._drives, lambda seen: not seen.enabled)
        if left is None:
            self._move()
        else:
            self._hold(left)

    # -- motion ------------------------------------------------------------------------------------------

    def _take_over(self) -> None:
        """Begin the motion where the joints are: what they differ from it fades out."""
        self._go(ControllerState.RUNNING)
        numbers = range(1, len(self._joints) + 1)
        counts = [self.dictionary[objects.POSITIONS, number].number() for number in numbers]
        actual = [
            joint.angle(one, self._counts_per_radian) for joint, one in zip(self._joints, counts, strict=True)
        ]
        self._offsets = [one - wanted for one, wanted in zip(actual, self._angles(), strict=True)]
        self._taken_over_s = 0.0
        self._move()

    def _settle(self) -> None:
        """Bring the wearer to rest: nobody walks on with drives that have stopped."""
        self.generator.step(self._period_s(), self.generator.at_rest, self._shape())

    def _period_s(self) -> float:
        return self.dictionary[CYCLE_PERIOD].number() / 1e6

    def _angles(self) -> list[float]:
        left, right = self.generator.legs()
        return [*left, *right]

    def _move(self) -> None:
        dt = self._period_s()
        self.step_motion(dt)
        targets = self.set_points()
        for place in self._led:
            self._set(place + 1, ENABLE_OPERATION, targets[place])

    def step_motion(self, dt: float) -> None:
        """Move the wearer's motion on by `dt` seconds."""
        self._taken_over_s = min(self._taken_over_s + dt, _TAKE_OVER_S)
        self.generator.step(dt, Activity(self.dictionary[objects.ACTIVITY].number()), self._shape())

    def set_points(self) -> list[int]:
        """Return the set-points of the joints (counts)."""
        left = 1.0 - smooth(self._taken_over_s / _TAKE_OVER_S)
        parts = zip(self._joints, self._angles(), self._offsets, self.strays, strict=True)
        return [
            joint.counts(angle + left * offset + stray, self._counts_per_radian)
            for joint, angle, offset, stray in parts
        ]

    def _command_where_they_are(self) -> None:
        """Slow down a drive that moves uncommanded; only ENABLING brings one up."""
        enabling = self.controller_state is ControllerState.ENABLING
        for place, seen in zip(self._led, self._drives, strict=True):
            number = place + 1
            controlword = seen.way_up if enabling else QUICK_STOP
            self._set(number, controlword, self.dictionary[objects.POSITIONS, number].number())

    def _set(self, number: int, controlword: int, target: int) -> None:
        entries = self._commands[number - 1]
        for entry, value in zip(entries, (controlword, _CYCLIC_SYNCHRONOUS_POSITION, target), strict=True):
            entry.value = value
