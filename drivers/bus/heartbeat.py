"""Our own heartbeat on one bus, sent only as long as this process is alive and not merely there.

Devices that are armed (`arming.py`) stop when it stays away. It therefore ends by itself when the bus's own
thread, or whoever calls `feed`, has not turned for `HUNG_S`.
"""

import time

from drivers.bus.bus import BusUser, CanBus
from drivers.bus.cycles import Cycle, Cycles
from drivers.bus.nmt import HEARTBEAT, NmtState
from drivers.errors import SettingsError

HUNG_S = 1.0


class Heartbeat(BusUser):
    """Heartbeat producer (CiA 301 §7.2.8.3.2) of `[can.NAME] node_id`; holds the bus open.

    Raises `SettingsError` where the bus has no node id of ours.
    """

    def __init__(self, bus: CanBus, period_s: float) -> None:
        if bus.settings.node_id is None:
            raise SettingsError(f"[can.{bus.name}] lacks node_id: our own, which our heartbeat is sent under")
        self.node_id = bus.settings.node_id
        self.period_s = period_s
        self.problem: str | None = None  # why a device must not rely on it, in words
        self._bus = bus
        self._fed_ns = self._ticked_ns = 0
        self._cycle = Cycle(HEARTBEAT + self.node_id, bytes([NmtState.OPERATIONAL]), period_s, self._alive)
        self._cycles = Cycles(f"can {bus.name} heartbeat", [self._cycle], bus.send)

    def start(self) -> None:
        """Send from when the bus opens on; whoever starts it feeds it."""
        self.feed()
        self._bus.subscribe(HEARTBEAT + self.node_id, self._on_other)
        self._bus.hold(self)

    def stop(self) -> None:
        """Send no more. Idempotent; not for the bus's own thread."""
        self._bus.release(self)
        self._cycles.stop()
        self._bus.unsubscribe(HEARTBEAT + self.node_id, self._on_other)

    def feed(self) -> None:
        """Note that everything that the devices rely on still runs."""
        self._fed_ns = time.monotonic_ns()

    def beat(self) -> None:
        """Send one now; raises `Unavailable`."""
        self._bus.send(self._cycle.can_id, self._cycle.data)

    def bus_opened(self) -> None:
        self._ticked_ns = time.monotonic_ns()
        self._cycles.start()

    def bus_closed(self) -> None:
        self._cycles.stop()

    def tick(self, now_ns: int) -> None:
        self._ticked_ns = now_ns

    def _alive(self) -> bool:
        return time.monotonic_ns() - min(self._fed_ns, self._ticked_ns) < HUNG_S * 1e9

    def _on_other(self, _stamp_ns: int, _data: bytes) -> None:
        self.problem = (
            f"somebody else on bus {self._bus.name} sends heartbeats as node {self.node_id}, "
            f"and would go on without us: give [can.{self._bus.name}] another node_id"
        )
