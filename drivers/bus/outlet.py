"""Sending of one SDO channel's requests to the bus."""

from collections.abc import Callable
from dataclasses import dataclass

from drivers.bus.bus import CanBus


@dataclass(frozen=True, slots=True)
class Requests:
    """The outlet of one node's SDO channel (`sdo.channel.Outlet`)."""

    bus: CanBus
    can_id: int

    def offer(self, data: bytes, wanted: Callable[[], bool]) -> Callable[[], bool]:
        return self.bus.offer(self.can_id, data, wanted)

    def send_urgent(self, data: bytes) -> bool:
        return self.bus.send_urgent(self.can_id, data)
