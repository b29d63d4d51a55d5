"""One axis of a bus that nobody else leads, put under power: its drive, our heartbeat, other masters.

What enables it is `PowerDrive.step_up`, as everywhere. The drive watches our heartbeat meanwhile, so that it
stops by itself when this program dies, is suspended, or stands still (`drivers/bus/arming.py`).
"""

import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager

from drivers.bus.arming import Arming
from drivers.bus.bus import CanBus
from drivers.bus.heartbeat import Heartbeat
from drivers.bus.master import NMT_COMMAND, SYNC
from drivers.bus.node import shared_node
from drivers.bus.settings import SDO_REQUEST, CanSettings, Role
from drivers.errors import DriverError, Unavailable
from drivers.joint.power import PowerDrive
from drivers.joint.quantities import AXIS_OFFSET
from drivers.joint.settings import JointSettings
from drivers.scan.scan import await_open
from eds import Description

HEARTBEAT_S = 0.1
LISTEN_S = 2.0  # for another master, before anything is done
UP_S = 5.0  # for the node to come up, and to be armed
TICK_S = 0.02
_RPDOS = (0x200, 0x300, 0x400, 0x500)
_NODES = range(1, 128)


class Foreign:
    """Hears whether somebody else leads the bus, or speaks to its nodes."""

    def __init__(self, bus: CanBus, node_id: int, others: Collection[int] = ()) -> None:
        """`others` are further nodes that nobody may lead meanwhile."""
        self.words: str | None = None  # what was heard
        for can_id, words in {
            NMT_COMMAND: "NMT commands",
            SYNC: "SYNC",
            **{SDO_REQUEST + node: f"SDO requests to node {node}" for node in _NODES},
            **{base + node: f"process data to node {node}" for node in {node_id, *others} for base in _RPDOS},
        }.items():
            bus.subscribe(can_id, self._noting(words))
        self._bus = bus

    def hear(self, nodes: Mapping[int, int]) -> None:
        """Notice process data on these identifiers as well, each with the node that takes it."""
        for can_id, node in nodes.items():
            self._bus.subscribe(can_id, self._noting(f"process data to node {node}"))

    def check(self) -> None:
        """Raise `Unavailable` where somebody was heard."""
        if self.words is not None:
            raise Unavailable(self.words)

    def _noting(self, words: str) -> Callable[[int, bytes], None]:
        def note(_stamp_ns: int, _data: bytes) -> None:
            self.words = f"somebody else is on the bus, who sends {words}"

        return note


class Power:
    """An axis that may be put under power, between `opened` and its end."""

    def __init__(
        self, bus: CanBus, settings: JointSettings, description: Description, others: Collection[int] = ()
    ) -> None:
        self.bus = bus
        self.foreign = Foreign(bus, settings.node_id, others)
        self.node = shared_node(bus, settings.node_id, description, settings)
        self.drive = PowerDrive(self.node, settings)
        self.heartbeat = Heartbeat(bus, HEARTBEAT_S)
        self.left: str | None = None  # what stays in the drive, in words, once it is closed
        self._arming = Arming(self.node, self.heartbeat, [settings.axis * AXIS_OFFSET], lambda: None)

    @property
    def objection(self) -> str | None:
        """Why it must not have power now, or not any longer, in words."""
        if not self.bus.is_open:
            return f"the bus is closed: {self.bus.problem}"
        if self.foreign.words is not None:
            return self.foreign.words
        if not self._arming.armed:
            return f"the drive would not stop by itself if this program died: {self._arming.text}"
        return self.node.problem(time.monotonic_ns())

    def open(self, wait: Callable[[float], object]) -> None:
        """Listen, then begin; raises `Unavailable` where it must not be. Call `close` in any case."""
        self.bus.start()
        await_open(self.bus, wait)
        wait(LISTEN_S)
        self.foreign.check()
        self.heartbeat.start()
        self._arming.start()
        until = time.monotonic() + UP_S
        while (why := self.objection) is not None:
            self.foreign.check()
            if time.monotonic() > until:
                raise Unavailable(why)
            self.heartbeat.feed()
            wait(TICK_S)

    def close(self) -> None:
        """Let go of it all."""
        try:
            self._arming.disarm().result(UP_S)
        except (DriverError, TimeoutError) as error:
            self.left = f"its 1016h may still watch our heartbeat, until it is switched off and on: {error}"
        self._arming.stop()
        self.heartbeat.stop()
        self.bus.stop()


@contextmanager
def opened(
    name: str,
    settings: CanSettings,
    joint: JointSettings,
    description: Description,
    wait: Callable[[float], object],
    others: Collection[int] = (),
) -> Iterator[Power]:
    """Return the axis, with the bus opened as its master; raises `DriverError` where it must not be.

    `others` are the nodes of further drives, which nobody may lead meanwhile.
    """
    power = Power(CanBus(name, settings, Role.MASTER), joint, description, others)
    try:
        power.open(wait)
        yield power
    finally:
        power.close()
