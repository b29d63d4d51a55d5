"""A CAN interface that takes frames only as long as a test gives it room."""

import queue
import threading
from collections.abc import Sequence

from drivers.bus.frames import Frame
from drivers.inbox import Inbox


class NarrowTransport:
    """A `Transport`; it never waits itself unless it `blocks`."""

    warning: str | None = None
    full = "interface can9 does not send: does anybody on the bus acknowledge?"

    def __init__(self, room: int = 0, *, blocks: bool = False) -> None:
        self.dropped = 0
        self.blocks = blocks
        self.sent: list[tuple[int, bytes]] = []
        self.threads: list[str] = []  # who sent each of them
        self.asked = 0  # times it had no room
        self.closed = False
        self.fails: Exception | None = None  # raised by whoever sends
        self.incoming: Inbox[Frame | Exception] = Inbox()
        self.room = room
        self.awaited = False  # somebody waits, or has waited, for room
        self._changed = threading.Condition()

    def open(self, frames: int = 1_000_000) -> None:
        with self._changed:
            self.room += frames
            self._changed.notify_all()

    def receive(self, timeout_s: float) -> Sequence[Frame]:
        try:
            found = self.incoming.get(timeout=timeout_s)
        except queue.Empty:
            return ()
        if isinstance(found, Exception):
            raise found
        return (found,)

    def try_send(self, can_id: int, data: bytes) -> bool:
        with self._changed:
            if self.fails is not None:
                raise self.fails
            if not self.room:
                self.asked += 1
                self._changed.wait_for(lambda: self.room or self.closed or not self.blocks)
            if not self.room:
                return False
            self.room -= 1
            self.sent.append((can_id, data))
            self.threads.append(threading.current_thread().name)
        return True

    def flush(self) -> bool:
        return True

    def await_room(self, timeout_s: float) -> None:
        with self._changed:
            self.awaited = True
            self._changed.wait_for(lambda: self.room or self.closed, timeout_s)

    def carried(self) -> tuple[int, int] | None:
        return None

    def accept(self, can_ids: frozenset[int] | None) -> None:
        pass

    def close(self) -> None:
        with self._changed:
            self.closed = True
            self._changed.notify_all()
