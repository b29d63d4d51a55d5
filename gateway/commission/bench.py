"""What commissioning reaches: a CAN bus whose drives are asked by SDO, one at a time, and never commanded."""

import threading
import time
from typing import Protocol

from drivers.bus.bus import CanBus
from drivers.bus.outlet import Requests
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import SDO_REQUEST, SDO_RESPONSE, CanSettings
from drivers.errors import DeviceAbort, Mismatch, Unavailable
from drivers.scan.scan import Found, scan

LISTEN_S = 2.0
OPEN_S = 5.0
TIMEOUT_S = 0.5


class Bench(Protocol):
    """The robot's bus while it is commissioned."""

    def nodes(self) -> Found:
        """Listen, then ask all; raises `Unavailable`."""
        ...

    def read(self, node: int, index: int, subindex: int = 0) -> bytes | None:
        """An object's bytes; `None` where the device has none. Raises `DriverError`."""
        ...

    def write(self, node: int, index: int, subindex: int, data: bytes) -> None:
        """Write and read back; raises `DriverError` where the device does not confirm it."""
        ...


class CanBench:
    """A real bus, open between `open` and `close`."""

    def __init__(self, name: str, settings: CanSettings) -> None:
        self._settings = settings
        self._bus = CanBus(name, settings)
        self._channels: dict[int, SdoChannel] = {}

    def nodes(self) -> Found:
        return scan(self._settings, LISTEN_S, threading.Event().wait, active=True)

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
        """An SDO request past all that waits; nobody waits for its answer. Raises `Unavailable`."""
        if not self._bus.is_open:
            self._open()
        self._bus.send_urgent(SDO_REQUEST + node, data)

    def close(self) -> None:
        for node, channel in self._channels.items():
            self._bus.unsubscribe(SDO_RESPONSE + node, channel.on_response)
        self._channels.clear()
        self._bus.stop()

    def channel(self, node: int) -> SdoChannel:
        """To a node, on the open bus. Raises `Unavailable`."""
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
