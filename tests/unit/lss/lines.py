"""Simulated devices that live on only while somebody sends: no answer is ever late, or early."""

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import eds
from drivers.bus.frames import FrameHandler
from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.clock import MILLISECOND_NS, Clock
from hil_sim.node.node import Node
from tests.unit.hil_sim.device_file import communication

VENDOR, PRODUCT, REVISION = 0x123, 0x456, 0x10001  # of `communication()`
ANSWER_MS, BOOT_MS = 2, 60


class Line:
    """A bus as the master sees it, with a node for each of `node_ids`; `loses` may keep answers back."""

    name = "line"

    def __init__(self, folder: Path, node_ids: dict[int, int]) -> None:
        """`node_ids` by serial number."""
        self.clock = Clock()
        self.bus = CanBus(self.clock)
        self.sent: list[tuple[int, bytes]] = []
        self.loses: Callable[[Frame], bool] = lambda frame: False
        self._handlers: dict[int, list[FrameHandler]] = defaultdict(list)
        self.bus.attach(self, self._take)
        path = communication().write(folder)
        self.nodes = {
            serial: self._node(path, serial, node_id, number)
            for number, (serial, node_id) in enumerate(node_ids.items())
        }
        self._run(BOOT_MS)

    def _node(self, path: Path, serial: int, node_id: int, number: int) -> Node:
        node = Node(self.clock, self.bus, f"{number}", 100 + number, eds.load(path, 100 + number))
        node.factory_node_id = node_id
        node.number_serially(serial)
        node.power_on()
        return node

    def _run(self, milliseconds: int) -> None:
        self.clock.run_until(self.clock.now_ns + milliseconds * MILLISECOND_NS)

    def _take(self, frame: Frame, _sender: object) -> None:
        if not self.loses(frame):
            for handler in tuple(self._handlers[frame.cob_id]):
                handler(self.clock.now_ns, frame.data)

    def send(self, can_id: int, data: bytes) -> None:
        self.sent.append((can_id, data))
        self.bus.send(Frame(can_id, data), self)
        self._run(BOOT_MS if can_id == 0x000 or data[0] == 0x04 else ANSWER_MS)

    def subscribe(self, can_id: int, handler: FrameHandler) -> None:
        self._handlers[can_id].append(handler)

    def unsubscribe(self, can_id: int, handler: FrameHandler) -> None:
        self._handlers[can_id].remove(handler)
