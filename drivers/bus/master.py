"""What a master sends by itself: SYNC and its own heartbeat, each at its own period (CiA 301 §7.2.5)."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from drivers.bus.nmt import NmtState
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable

NMT_COMMAND, SYNC, HEARTBEAT = 0x000, 0x080, 0x700
NMT_START = 0x01

Send = Callable[[int, bytes], None]


@dataclass(slots=True)
class _Cycle:
    can_id: int
    data: bytes
    period_s: float
    due: float


class MasterCycles:
    """Sends between `start` and `stop`, in a thread of its own; a frame that cannot be sent is counted."""

    def __init__(self, name: str, settings: CanSettings, send: Send) -> None:
        self.failed = 0
        self._name = name
        self._send = send
        self._settings = settings
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        cycles = list(_cycles(self._settings))
        if self._thread is None and cycles:
            self._stopping.clear()
            self._thread = threading.Thread(
                target=self._run, args=(cycles,), name=f"can {self._name} master", daemon=True
            )
            self._thread.start()

    def stop(self) -> None:
        if self._thread is not None:
            self._stopping.set()
            self._thread.join()
            self._thread = None

    def _run(self, cycles: list[_Cycle]) -> None:
        while not self._stopping.wait(max(0.0, min(cycle.due for cycle in cycles) - time.monotonic())):
            now = time.monotonic()
            for cycle in cycles:
                if cycle.due <= now:
                    self._send_one(cycle)
                    # A late one is not made up for: two SYNCs in a row would move setpoints twice.
                    cycle.due = max(cycle.due + cycle.period_s, now)

    def _send_one(self, cycle: _Cycle) -> None:
        try:
            self._send(cycle.can_id, cycle.data)
        except Unavailable:
            self.failed += 1


def _cycles(settings: CanSettings) -> list[_Cycle]:
    now = time.monotonic()
    cycles = []
    if settings.sync_period_s is not None:
        cycles.append(_Cycle(SYNC, b"", settings.sync_period_s, now))
    if settings.heartbeat_s is not None and settings.node_id is not None:
        state = bytes([NmtState.OPERATIONAL])
        cycles.append(_Cycle(HEARTBEAT + settings.node_id, state, settings.heartbeat_s, now))
    return cycles
