"""Hardware access of commissioning: CAN buses whose drives are read by SDO, one at a time.

They are commanded by a homing alone, for which one of them is put under power (`power.py`).
"""

import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from typing import Protocol

import msgspec

from drivers.bus.bus import CanBus
from drivers.bus.outlet import Requests
from drivers.bus.pdo import read_tpdos
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import SDO_REQUEST, SDO_RESPONSE, CanSettings
from drivers.errors import DeviceAbort, Mismatch, Unavailable
from drivers.joint.quantities import AXIS_OFFSET, quantities
from drivers.joint.remap import free_tpdos, mappable, remap
from drivers.joint.settings import JointSettings
from drivers.scan.scan import ScanResult, scan
from eds import Description
from gateway.commission.power import Power, opened

LISTEN_S = 2.0
OPEN_S = 5.0
TIMEOUT_S = 0.5
STORE, ALL, SAVE = 0x1010, 1, b"save"  # CiA 301 §7.5.2.13
STORE_S = 10.0  # for the answer: flash takes its time


class Bench(Protocol):
    """The robot's bus while it is commissioned."""

    def nodes(self) -> ScanResult:
        """Listen, then ask all; raises `Unavailable`."""
        ...

    def read(self, node: int, index: int, subindex: int = 0) -> bytes | None:
        """Return an object's bytes; `None` where the device has none. Raises `DriverError`."""
        ...

    def write(self, node: int, index: int, subindex: int, data: bytes) -> None:
        """Write and read back; raises `DriverError` where the device does not confirm it."""
        ...

    def map(self, node: int, axis: int, description: Description) -> str:
        """Bring what a joint's channels need into free TPDOs, and store it in the device (1010h).

        Returns what was done, in words. Raises `DriverError` where the device does not take all of it.
        """
        ...

    def power(
        self, joint: JointSettings, description: Description, others: Collection[int] = ()
    ) -> AbstractContextManager[Power]:
        """Return the axis as it may be put under power.

        Entering raises `DriverError` where it must not be.
        """
        ...


class CanBench:
    """A real bus, open between `open` and `close`."""

    def __init__(self, name: str, settings: CanSettings) -> None:
        self._settings = settings
        self._bus = CanBus(name, settings)
        self._channels: dict[int, SdoChannel] = {}
        self._nodes: frozenset[int] = frozenset()  # that were heard, or answered
        self._heard: frozenset[int] = frozenset()  # identifiers that are somebody's

    def check_opens(self) -> None:
        """Raise `Unavailable` where the bus is not there: before a person is asked anything."""
        self._open()
        self.close()

    def nodes(self) -> ScanResult:
        found = scan(self._settings, LISTEN_S, threading.Event().wait, active=True)
        self._nodes = frozenset(found.nodes)
        self._heard = frozenset(found.traffic.seen)
        return found

    def read(self, node: int, index: int, subindex: int = 0) -> bytes | None:
        try:
            return self.channel(node).upload(index, subindex)
        except DeviceAbort:
            return None

    def write(self, node: int, index: int, subindex: int, data: bytes) -> None:
        channel = self.channel(node)
        channel.download(index, subindex, data)
        kept = channel.upload(index, subindex)
        if kept != data:
            raise Mismatch(
                f"node {node}: {index:04X}h:{subindex} is {kept.hex(' ')} after {data.hex(' ')} was written"
            )

    def send_urgent(self, node: int, data: bytes) -> None:
        """Send an SDO request ahead of the queue, without waiting for its answer; raises `Unavailable`."""
        if not self._bus.is_open:
            self._open()
        self._bus.send_urgent(SDO_REQUEST + node, data)

    @contextmanager
    def listening(self, take: Callable[[int, bytes], None]) -> Iterator[None]:
        """Call `take` within the block with each SDO answer and its node id, in the bus's thread."""
        bus = self._bus
        handlers = {SDO_RESPONSE + node: partial(_hand_over, take, node) for node in range(1, 128)}
        for can_id, handler in handlers.items():
            bus.subscribe(can_id, handler)
        try:
            yield
        finally:
            for can_id, handler in handlers.items():
                bus.unsubscribe(can_id, handler)

    def map(self, node: int, axis: int, description: Description) -> str:
        channel, offset = self.channel(node), axis * AXIS_OFFSET
        free = list(free_tpdos(read_tpdos(channel, description), node, self._heard))
        if not free:
            raise Unavailable(f"node {node}: no TPDO is free")
        wanted = (one for one in quantities(description, axis) if not one.fast)
        done = remap(channel, description, free, offset, list(mappable(description, wanted)))
        channel.download(STORE, ALL, SAVE, STORE_S)
        return f"{done}; stored (1010h)"

    def power(
        self, joint: JointSettings, description: Description, others: Collection[int] = ()
    ) -> AbstractContextManager[Power]:
        self.close()  # it is opened as its master
        wait = threading.Event().wait
        return opened(self._bus.name, self._as_master(others), joint, description, wait, others)

    def _as_master(self, others: Collection[int]) -> CanSettings:
        """Return settings with a node id of our own that nobody has, and no cycles."""
        taken = {*self._nodes, *others, self._settings.node_id}
        ours = self._settings.node_id or next(node for node in range(127, 0, -1) if node not in taken)
        return msgspec.structs.replace(self._settings, node_id=ours, sync_period_s=None, heartbeat_s=None)

    def close(self) -> None:
        for node, channel in self._channels.items():
            self._bus.unsubscribe(SDO_RESPONSE + node, channel.on_response)
        self._channels.clear()
        self._bus.stop()
        self._bus = CanBus(
            self._bus.name, self._settings
        )  # that this one was closed is no problem of the next

    def channel(self, node: int) -> SdoChannel:
        """Return a channel to a node, on the open bus. Raises `Unavailable`."""
        if not self._bus.is_open:
            self._open()
        if node not in self._channels:
            label = f"node {node} on {self._bus.name}"
            channel = SdoChannel(label, Requests(self._bus, SDO_REQUEST + node), TIMEOUT_S)
            self._bus.subscribe(SDO_RESPONSE + node, channel.on_response)
            self._channels[node] = channel
        return self._channels[node]

    def _open(self) -> None:
        self._bus.start()
        until = time.monotonic() + OPEN_S
        while not self._bus.is_open:
            if self._bus.problem is not None or time.monotonic() > until:
                raise Unavailable(self._bus.problem or f"{self._bus.name} did not open within {OPEN_S:g} s")
            threading.Event().wait(0.01)


def _hand_over(take: Callable[[int, bytes], None], node: int, _stamp_ns: int, data: bytes) -> None:
    take(node, data)
