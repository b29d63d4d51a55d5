"""The one way out to a bus: nobody waits for another one's frame with a lock that a stop needs.

A frame is queued, and leaves in the thread of whoever finds nobody else sending: in its owner's as a rule.
Whoever is sending takes the urgent ones first that came meanwhile. Where the interface has no room, or may
block, the bus's sender thread does it, as soon as there is some.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from drivers.bus.frames import Transport
from drivers.errors import Unavailable
from drivers.realtime_priority import make_realtime

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
    """Return a frame that nothing overtakes; one that was sent."""
    return True


@dataclass(slots=True, eq=False)
class _Frame:
    can_id: int
    data: bytes
    until: float = float("inf")
    wanted: Callable[[], bool] = always
    taken: bool | Unavailable | None = None  # whether it was sent, or why not; `None` as long as it waits
    settled: threading.Event | None = None  # of who waits for that
    given_up: bool = False  # nobody waits for it any more: it is not tried again

    @property
    def is_urgent(self) -> bool:
        return self.until != float("inf")

    @property
    def key(self) -> Key:
        """The part that a newer urgent frame must share to replace this one."""
        return self.can_id, self.data[:_SDO_HEAD]

    def settle(self, taken: bool | Unavailable) -> None:
        """Settle it with its outcome; only the first call counts."""
        if self.taken is None:
            self.taken = taken
            if self.settled is not None:
                self.settled.set()


class Sender:
    """Sends between `start` and `stop`, from any thread; counts what left.

    Normal frames leave in the order in which they came, and no more of them wait than there are threads that
    wait with them. Urgent ones stand for older ones of the same identifier, SDO command and object.
    """

    def __init__(self, name: str, why_closed: Callable[[], str]) -> None:
        self.sent = self.sent_bytes = 0  # frames, and what they carried
        self._name = name
        self._why_closed = why_closed
        self._lock = threading.Lock()  # guards the queues; nobody sends or waits with it
        self._normal: deque[_Frame] = deque()
        self._urgent: dict[Key, _Frame] = {}
        self._transport: Transport | None = None
        self._in_hand: _Frame | None = None  # it is being sent just now
        self._at_work = threading.Lock()  # of who is sending; who does not get it at once leaves it to him
        self._order = threading.Event()  # for the thread: there is something that nobody else does
        self._thread: threading.Thread | None = None

    def start(self, transport: Transport) -> None:
        """Send by it from now on."""
        with self._lock:
            self._transport = transport
        self._thread = threading.Thread(
            target=self._run, args=(transport,), name=f"{self._name} out", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Send nothing more; who waits is told. Idempotent."""
        with self._lock:
            transport, self._transport = self._transport, None
            for frame in (*self._urgent.values(), *self._normal):
                frame.settle(Unavailable(self._why_closed()))
            self._urgent.clear()
            self._normal.clear()
        self._order.set()
        if transport is not None and not transport.blocks:
            with self._at_work:  # who has a frame in hand is done with it
                pass

    def join(self) -> None:
        """Join the thread: after `stop`, and after a transport that may block was closed."""
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def offer(self, can_id: int, data: bytes, wanted: Callable[[], bool] = always) -> Callable[[], bool]:
        """Let it wait its turn, without waiting for that; raises `Unavailable`.

        `wanted` is asked under a lock when the frame's turn has come; where it says no, nothing is sent. What
        is returned is to be called, and sends it, or waits, `SEND_TIMEOUT_S` at most, until it was sent; it
        says whether it was. It raises `BusFull` where the bus takes nothing, `StillLeaving` where the frame
        can no longer be kept back.
        """
        with self._lock:
            transport = self._open()
            frame = self._queue(_Frame(can_id, data, wanted=wanted))
        return lambda: self._see_off(transport, frame)

    def send(self, can_id: int, data: bytes) -> None:
        """Return when the frame was taken; raises `Unavailable`, after `SEND_TIMEOUT_S` at most."""
        self.offer(can_id, data)()

    def send_urgent(self, can_id: int, data: bytes) -> bool:
        """Return whether the frame was taken at once. Else it goes ahead of all others, for `URGENT_S`.

        Never blocks and never raises. Where the bus is not open, nothing is sent.
        """
        frame = _Frame(can_id, data, until=time.monotonic() + URGENT_S)
        with self._lock:
            transport = self._transport
            if transport is None:
                return False
            self._queue_urgent(frame)
        self._work(transport, only_urgent=True)
        return frame.taken is True

    def _see_off(self, transport: Transport, frame: _Frame) -> bool:
        if frame.taken is None:
            self._work(transport, until=frame)
        if frame.taken is None:
            self._await(frame, transport.full)
        if isinstance(frame.taken, Unavailable):
            raise frame.taken
        return frame.taken is True

    def _await(self, frame: _Frame, full: str) -> None:
        with self._lock:
            settled = frame.settled = frame.settled or threading.Event()
        if frame.taken is not None or settled.wait(SEND_TIMEOUT_S):
            return
        with self._lock:
            if frame.taken is not None:
                return
            if frame is not self._in_hand and not frame.is_urgent:
                self._normal.remove(frame)
                raise BusFull(full)
            frame.given_up = True
        if not settled.wait(ROOM_S):
            raise StillLeaving(f"{full} It may still leave")

    # Who sends.

    def _work(self, transport: Transport, *, only_urgent: bool = False, until: _Frame | None = None) -> None:
        """Send what waits, `until` that has gone, unless somebody does: then he does that too.

        What is left is the thread's.
        """
        if transport.blocks:
            self._order.set()
        elif self._at_work.acquire(blocking=False):
            self._empty_and_leave(transport, only_urgent=only_urgent, until=until)

    def _run(self, transport: Transport) -> None:
        """Run the thread that does the blocking sends."""
        make_realtime()
        while self._transport is transport:
            self._order.wait()
            self._order.clear()
            self._at_work.acquire()
            if not self._empty_and_leave(transport):
                self._await_room(transport)

    def _await_room(self, transport: Transport) -> None:
        try:
            transport.await_room(ROOM_S)
        except Exception:  # noqa: BLE001 - whoever receives from it finds that it is gone
            time.sleep(ROOM_S)

    def _empty_and_leave(
        self, transport: Transport, *, only_urgent: bool = False, until: _Frame | None = None
    ) -> bool:
        """Hand over what waits, and leave work; the thread does what is left. Whether there was room."""
        try:
            room = self._empty(transport, only_urgent=only_urgent, until=until)
        finally:
            self._at_work.release()
        if self._urgent or self._normal or not room:  # also what came in this very moment
            self._order.set()
        return room

    def _empty(self, transport: Transport, *, only_urgent: bool, until: _Frame | None) -> bool:
        """Hand over what waits; whether the interface took it all. For who is at work."""
        while until is None or until.taken is None:
            frame = self._take(transport, only_urgent=only_urgent)
            if frame is None:
                break
            taken: bool | Unavailable
            try:
                taken = self._hand_over(transport, frame.can_id, frame.data)
            except Unavailable as error:
                taken = error
            with self._lock:
                self._in_hand = None
                if taken is False and self._transport is transport:
                    self._put_back(frame, transport.full)
                    return False
                frame.settle(taken or Unavailable(self._why_closed()))
        return _is_flushed(transport)

    def _hand_over(self, transport: Transport, can_id: int, data: bytes) -> bool:
        """Return whether the interface took it; raises `Unavailable`, whatever went wrong."""
        try:
            taken = transport.try_send(can_id, data)
        except Unavailable:
            raise
        except Exception as error:
            raise Unavailable(
                f"bus {self._name}: internal error in sending: {type(error).__name__}: {error}"
            ) from error
        self.sent += taken
        self.sent_bytes += taken * len(data)
        return taken

    def _take(self, transport: Transport, *, only_urgent: bool) -> _Frame | None:
        """Take the next frame out of its queue; frames that are over or unwanted are dropped."""
        with self._lock:
            while self._transport is transport and (self._urgent or (self._normal and not only_urgent)):
                key = next(iter(self._urgent), None)
                frame = self._normal.popleft() if key is None else self._urgent.pop(key)
                if self._is_wanted(frame):
                    self._in_hand = frame
                    return frame
        return None

    def _is_wanted(self, frame: _Frame) -> bool:
        """Return whether it may still leave; tell its sender if it may not."""
        try:
            wanted = frame.wanted() and time.monotonic() < frame.until
        except Exception as error:  # noqa: BLE001 - it is its owner's, and nobody else's
            frame.settle(Unavailable(f"bus {self._name}: internal error: {type(error).__name__}: {error}"))
            return False
        if not wanted:
            frame.settle(False)
        return wanted

    # What follows is for who has the lock.

    def _open(self) -> Transport:
        if self._transport is None:
            raise Unavailable(self._why_closed())
        return self._transport

    def _queue(self, frame: _Frame) -> _Frame:
        """Return the frame to wait for: one that is queued urgently already is not sent twice."""
        same = (frame.can_id, frame.data)
        for one in (self._urgent.get(frame.key), self._in_hand):
            if one is not None and one.is_urgent and (one.can_id, one.data) == same:
                return one
        self._normal.append(frame)
        return frame

    def _queue_urgent(self, frame: _Frame) -> None:
        older = self._urgent.get(frame.key)
        if older is None and len(self._urgent) + (self._in_hand is not None) >= MAX_URGENT:
            older = self._urgent.pop(next(iter(self._urgent)))
        self._urgent[frame.key] = frame
        if older is not None:
            older.settle(self._overtaken())

    def _put_back(self, frame: _Frame, full: str) -> None:
        """Keep it as the first of its queue, as there was no room, unless a newer one stands for it."""
        if not frame.is_urgent and frame.given_up:
            frame.settle(BusFull(full))
        elif not frame.is_urgent:
            self._normal.appendleft(frame)
        elif frame.key in self._urgent:
            frame.settle(self._overtaken())
        else:
            self._urgent = {frame.key: frame, **self._urgent}

    def _overtaken(self) -> Unavailable:
        return Unavailable(f"bus {self._name}: a newer request took its place")


def _is_flushed(transport: Transport) -> bool:
    try:
        return transport.flush()
    except Exception:  # noqa: BLE001 - whoever receives from it finds that it is gone
        return True
