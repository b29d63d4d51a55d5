"""Frames that are sent again and again, each at its own period, by one thread."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.errors import Unavailable
from drivers.realtime_priority import make_realtime

Send = Callable[[int, bytes], None]


@dataclass(frozen=True, slots=True)
class Cycle:
    """One frame; it is left out while it is not `wanted`."""

    can_id: int
    data: bytes
    period_s: float
    wanted: Callable[[], bool] = lambda: True


class Cycles:
    """Sends between `start` and `stop`, both idempotent; a frame that cannot be sent is counted."""

    def __init__(self, name: str, cycles: Sequence[Cycle], send: Send) -> None:
        self.failed = 0
        self._name = name
        self._cycles = tuple(cycles)
        self._send = send
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._life = threading.Lock()

    def start(self) -> None:
        with self._life:
            if self._thread is None and self._cycles:
                self._stopping.clear()
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()

    def stop(self) -> None:
        with self._life:
            if self._thread is not None:
                self._stopping.set()
                self._thread.join()
                self._thread = None

    def _run(self) -> None:
        make_realtime()
        due = dict.fromkeys(self._cycles, time.monotonic())
        while not self._stopping.wait(max(0.0, min(due.values()) - time.monotonic())):
            now = time.monotonic()
            for cycle, at in due.items():
                if at <= now:
                    self._send_one(cycle)
                    due[cycle] = next_due(at, cycle.period_s, now)

    def _send_one(self, cycle: Cycle) -> None:
        try:
            if cycle.wanted():
                self._send(cycle.can_id, cycle.data)
        except Unavailable:
            self.failed += 1


def next_due(due: float, period_s: float, now: float) -> float:
    """Return when the next frame is due: without drift, but missed ones are not made up for.

    Two SYNCs in a row would move setpoints twice.
    """
    following = due + period_s
    return following if following > now else now + period_s
