"""Queue from robots' feeds to the predicting thread: in order, and bounded."""

import collections
import threading
from typing import Final, Generic, TypeVar

from server_gui.core.follow.events import Telemetry

Thing = TypeVar("Thing")

MOST_NS: Final = 10_000_000_000  # of rows that may wait, robot by robot


class Inbox(Generic[Thing]):
    """Queue of events, and of marks between them.

    `put` from any thread; where nobody takes, a robot's oldest rows go, and are counted in `lost`.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._changed = threading.Condition()
        self._waiting: dict[str, collections.deque[Thing]] = {}
        self._closed = False

    def put(self, robot: str, event: Thing) -> None:
        """Hand an event over; returns at once."""
        with self._changed:
            waiting = self._waiting.setdefault(robot, collections.deque())
            waiting.append(event)
            if isinstance(event, Telemetry):
                self._forget(waiting, event.batch.received_ns - MOST_NS)
            self._changed.notify()

    def take(self, within_s: float | None = None) -> dict[str, "collections.deque[Thing]"] | None:
        """Wait for events, so long; then all that has come, robot by robot; None where `close` was called."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._closed, within_s)
            taken, self._waiting = self._waiting, {}
        return None if self._closed else taken

    def close(self) -> None:
        """End the waiting."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def _forget(self, waiting: "collections.deque[Thing]", before_ns: int) -> None:
        while isinstance(oldest := waiting[0], Telemetry) and oldest.batch.received_ns < before_ns:
            waiting.popleft()
            self.lost += len(oldest.batch.stamps_ns)
