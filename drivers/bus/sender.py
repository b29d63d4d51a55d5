"""The one way out to a bus: no caller ever waits for another one's frame while it holds a lock.

A frame leaves in its caller's own thread where nothing waits and the interface takes it at once. Else it
waits here, and the bus's sender thread hands it over as soon as there is room: urgent frames first.
"""

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field

from drivers.bus.frames import Transport
from drivers.bus.urgency import make_urgent
from drivers.errors import Unavailable

SEND_TIMEOUT_S = 0.1  # how long a frame waits for a bus that takes none
URGENT_S = 1.0  # how long an urgent one does, which nobody waits for
MAX_URGENT = 256  # as many as two for each of 127 nodes
ROOM_S = 0.05  # how long the thread waits for room before it looks whether the bus was closed
_SDO_HEAD = 4  # command, index and subindex: what an SDO request is about

Key = tuple[int, bytes]


class BusFull(Unavailable):
    """The bus is open, and takes nothing: the frame was not sent."""


class StillLeaving(BusFull):
    """The bus takes nothing, and the frame is in its interface's hands: nobody knows whether it leaves."""


def always() -> bool:
    """A frame that nothing overtakes; one that was sent."""
    return True


def _not_sent() -> bool:
    return False


@dataclass(slots=True, eq=False)
class _Frame:
    can_id: int
    data: bytes
    until: float = float("inf")
    wanted: Callable[[], bool] = always
    taken: Future[bool] = field(default_factory=Future)

    @property
    def key(self) -> Key:
        """What a newer urgent frame must share with this one to stand for it."""
        return self.can_id, self.data[:_SDO_HEAD]


class Sender:
    """Sends between `start` and `stop`, from any thread; counts what left.

    Normal frames leave in the order in which they came, and no more of them wait than there are threads that
    wait with them. Urgent ones stand for older ones of the same identifier, SDO command and object.
    """

    def __init__(self, name: str, why_closed: Callable[[], str]) -> None:
        self.sent = self.sent_bytes = 0  # frames, and what they carried
        self._name = name
        self._why_closed = why_closed
        self._changed = threading.Condition(threading.Lock())  # guards all of this; never held for long
        self._normal: deque[_Frame] = deque()
        self._urgent: dict[Key, _Frame] = {}
        self._transport: Transport | None = None
        self._thread: threading.Thread | None = None

    def start(self, transport: Transport) -> None:
        """Send by it from now on."""
        run = self._push if transport.blocks else self._feed
        with self._changed:
            self._transport = transport
        self._thread = threading.Thread(target=run, args=(transport,), name=f"{self._name} out", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Send nothing more; who waits is told. Idempotent."""
        with self._changed:
            self._transport = None
            for frame in (*self._urgent.values(), *self._normal):
                frame.taken.set_exception(Unavailable(self._why_closed()))
            self._urgent.clear()
            self._normal.clear()
            self._changed.notify()

    def join(self) -> None:
        """After `stop`, and after a transport that may block was closed."""
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def offer(self, can_id: int, data: bytes, wanted: Callable[[], bool] = always) -> Callable[[], bool]:
        """Send it now, or let it wait its turn, without waiting for that; raises `Unavailable`.

        `wanted` is asked under a lock when the frame's turn has come; where it says no, nothing is sent. What
        is returned waits, `SEND_TIMEOUT_S` at most, and says whether the frame was sent; it raises
        `BusFull` where the bus takes nothing, `StillLeaving` where the frame can no longer be kept back.
        """
        with self._changed:
            transport = self._transport
            if transport is None:
                raise Unavailable(self._why_closed())
            waits = transport.blocks or self._normal or self._urgent
            if not waits and not wanted():
                return _not_sent
            if not waits and self._hand_over(transport, can_id, data):
                return always
            frame = self._queue(_Frame(can_id, data, wanted=wanted))
        return lambda: self._await(frame, transport.full)

    def send(self, can_id: int, data: bytes) -> None:
        """Return when the frame was taken; raises `Unavailable`, after `SEND_TIMEOUT_S` at most."""
        self.offer(can_id, data)()

    def send_urgent(self, can_id: int, data: bytes) -> bool:
        """Whether the frame was taken at once. Else it goes ahead of all others, for `URGENT_S`.

        Never blocks and never raises. Where the bus is not open, nothing is sent.
        """
        with self._changed:
            transport = self._transport
            if transport is None:
                return False
            with contextlib.suppress(Unavailable):
                if not (transport.blocks or self._urgent) and self._hand_over(transport, can_id, data):
                    return True
            self._queue_urgent(_Frame(can_id, data, until=time.monotonic() + URGENT_S))
        return False

    def _await(self, frame: _Frame, full: str) -> bool:
        with contextlib.suppress(TimeoutError):
            return frame.taken.result(SEND_TIMEOUT_S)
        with self._changed:
            if not frame.taken.done():
                if frame not in self._normal:
                    raise StillLeaving(f"{full} It may still leave")
                self._normal.remove(frame)
                raise BusFull(full)
        return frame.taken.result()

    # The thread.

    def _feed(self, transport: Transport) -> None:
        """Hand over what waits whenever there is room."""
        make_urgent()
        while True:
            with self._changed:
                if not self._await_work(transport):
                    return
                room = self._empty(transport)
            if not room:
                transport.await_room(ROOM_S)

    def _push(self, transport: Transport) -> None:
        """Send one frame after the other where that may block: without the lock."""
        make_urgent()
        while True:
            with self._changed:
                if not self._await_work(transport):
                    return
                frame = self._first()
                if frame is None:
                    continue
                self._remove(frame)
            try:
                self._hand_over(transport, frame.can_id, frame.data)
            except Unavailable as error:
                frame.taken.set_exception(error)
            else:
                frame.taken.set_result(True)

    # What follows is for who has the lock.

    def _queue(self, frame: _Frame) -> _Frame:
        """The frame to wait for: where the same one waits already, urgently, it does not leave twice."""
        urgent = self._urgent.get(frame.key)
        if urgent is not None and urgent.data == frame.data:
            return urgent
        self._normal.append(frame)
        self._changed.notify()
        return frame

    def _queue_urgent(self, frame: _Frame) -> None:
        older = self._urgent.get(frame.key)
        if older is None and len(self._urgent) == MAX_URGENT:
            older = self._urgent.pop(next(iter(self._urgent)))
        self._urgent[frame.key] = frame
        if older is not None:
            older.taken.set_exception(Unavailable(f"bus {self._name}: a newer request took its place"))
        self._changed.notify()

    def _await_work(self, transport: Transport) -> bool:
        """Wait for something to send; `False` when the bus was closed."""
        self._changed.wait_for(
            lambda: (
                self._transport is not transport or self._urgent or self._normal or not _is_flushed(transport)
            )
        )
        return self._transport is transport

    def _empty(self, transport: Transport) -> bool:
        """Hand over what waits; whether the interface took it all."""
        while (frame := self._first()) is not None:
            try:
                if not self._hand_over(transport, frame.can_id, frame.data):
                    return False
            except Unavailable as error:
                frame.taken.set_exception(error)
            else:
                frame.taken.set_result(True)
            self._remove(frame)
        return _is_flushed(transport)

    def _first(self) -> _Frame | None:
        """Whose turn it is; what is over, or not wanted any more, is not sent."""
        for frame in (*self._urgent.values(), *self._normal):
            if frame.wanted() and time.monotonic() < frame.until:
                return frame
            self._remove(frame)
            frame.taken.set_result(False)
        return None

    def _remove(self, frame: _Frame) -> None:
        if self._urgent.get(frame.key) is frame:
            del self._urgent[frame.key]
        else:
            self._normal.remove(frame)

    def _hand_over(self, transport: Transport, can_id: int, data: bytes) -> bool:
        """Whether the interface took it; raises `Unavailable`, whatever went wrong."""
        try:
            taken = transport.try_send(can_id, data)
            if taken and not transport.flush():
                self._changed.notify()
        except Unavailable:
            raise
        except Exception as error:
            raise Unavailable(
                f"bus {self._name}: internal error in sending: {type(error).__name__}: {error}"
            ) from error
        self.sent += taken
        self.sent_bytes += taken * len(data)
        return taken


def _is_flushed(transport: Transport) -> bool:
    try:
        return transport.flush()
    except Unavailable:
        return True  # whoever receives from it finds that it is gone
