"""The simulated CAN bus: frames wait, arbitrate by identifier, and take their time at the bit rate."""

import heapq
from collections.abc import Callable, Collection
from typing import NamedTuple

from hil_sim.clock import SECOND_NS, Clock

# ISO 11898-1: a data frame with an 11-bit identifier has 44 bits and its data, and 3 of intermission follow;
# 18 more with a 29-bit identifier. Stuff bits depend on the content; this share of the stuffable bits is what
# drive traffic shows on average (8 bytes: 118.25 bits in all, 8457 frames/s at 1 Mbit/s).
_FRAME_BITS = 47
_EXTENDED_BITS = 18
_STUFFABLE_BITS = 34
_STUFFING = 0.074
# ISO 11898-1: what follows a bit error, at its longest. Superposed error flags, delimiter, intermission.
_ERROR_FRAME_BITS = 12 + 8 + 3


def _bits(length: int, extended: bool) -> float:
    content = 8 * length + (_EXTENDED_BITS if extended else 0)
    return _FRAME_BITS + content + _STUFFING * (_STUFFABLE_BITS + content)


_BITS = {extended: [_bits(length, extended) for length in range(9)] for extended in (False, True)}


class Frame(NamedTuple):
    """One CAN frame; `cob_id` is the identifier, `data` 0 to 8 bytes (none in a remote frame)."""

    cob_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False

    def bits(self) -> float:
        """Length on the wire, intermission and average stuffing included."""
        return _BITS[self.extended][len(self.data)]

    def arbitration(self) -> int:
        """Return its rank, of which the lowest wins: a standard frame goes before an extended one like it."""
        base = self.cob_id if self.extended else self.cob_id << 18
        return base << 2 | self.extended << 1 | self.remote


# Classes of error frames (Linux can/error.h), as an interface sees them.
BUS_ERROR = 0x088  # a protocol violation (0x008), an error on the bus (0x080)
BUS_OFF, RESTARTED = 0x040, 0x100  # of the interface's own controller

_MOST_WAITING = 16_384  # frames, about two seconds at 1 Mbit/s: controllers have no room for more
_EXTENDED_ROUTE = -1  # of every 29-bit identifier: who filters takes standard frames alone

Receiver = Callable[[Frame, object], None]
ErrorListener = Callable[[int], None]  # the class of the error


class Disturbance:
    """Effect of a fault on the frames of a bus; this one lets them all pass."""

    def leaves(self, frame: Frame, sender: object, /) -> bool:  # noqa: ARG002 - the shape of a disturbance
        """Return whether a frame that is sent queues for the bus; `CanBus.queue` goes past everybody."""
        return True

    def survives(self, frame: Frame, sender: object, /) -> bool:  # noqa: ARG002 - the shape of a disturbance
        """Return whether a frame gets over the wire; else an error frame ends it, and it is sent again."""
        return True

    def arrives(self, frame: Frame, sender: object, receiver: object, /) -> bool:  # noqa: ARG002 - its shape
        """Return whether one receiver takes a frame that came over the wire."""
        return True


_Waiting = tuple[int, int, Frame, object]  # arbitration, order of sending, frame, sender


class CanBus:
    """A bus that carries one frame at a time.

    A frame reaches every receiver but its sender, in the order in which frames win arbitration, at the moment
    its last bit is over; at once with `carries_at_once`, where a real bus behind a bridge gives frames their
    time. Receivers get the frame and who sent it. `disturbances` may stand in the way.
    """

    def __init__(self, clock: Clock, bitrate: int = 1_000_000) -> None:
        self.clock = clock
        self.bitrate = bitrate
        self.carries_at_once = False
        self.frames_carried = 0
        self.frames_lost = 0
        self.busy_ns = 0
        self.disturbances: list[Disturbance] = []
        self._receivers: dict[object, Receiver] = {}
        self._filters: dict[object, Collection[int]] = {}
        self._routes: dict[int, tuple[tuple[object, Receiver], ...]] = {}
        self._error_listeners: dict[object, ErrorListener] = {}
        self._pending: list[_Waiting] = []
        self._queued = 0
        self._transmitting = False
        self._on_wire: _Waiting | None = None  # also `None` where its sender fell silent in the middle

    def attach(self, participant: object, receive: Receiver, on_error: ErrorListener | None = None) -> None:
        """Take part; `on_error` is told of each error frame."""
        self._receivers[participant] = receive
        self._routes.clear()
        if on_error is not None:
            self._error_listeners[participant] = on_error

    def detach(self, participant: object) -> None:
        self._receivers.pop(participant, None)
        self._filters.pop(participant, None)
        self._routes.clear()
        self._error_listeners.pop(participant, None)

    def accept(self, participant: object, cob_ids: Collection[int]) -> None:
        """Set its acceptance filter: from now on it receives standard frames with these identifiers alone."""
        self._filters[participant] = cob_ids
        self._routes.clear()

    @property
    def pending(self) -> int:
        """Frames that wait for the bus."""
        return len(self._pending)

    def pending_of(self, sender: object, cob_id: int) -> int:
        """Return those of one sender with one identifier."""
        return sum(one is sender and frame.cob_id == cob_id for _, _, frame, one in self._pending)

    def send(self, frame: Frame, sender: object) -> None:
        """Queue a frame; it goes out when it wins the bus."""
        if not self.disturbances or all(one.leaves(frame, sender) for one in self.disturbances):
            self.queue(frame, sender)

    def send_past(self, frame: Frame, sender: object, disturbance: Disturbance) -> None:
        """Queue what `disturbance` has held back or made, unless one that acts since later stops it."""
        held = self.disturbances
        later = held[held.index(disturbance) + 1 :] if disturbance in held else held
        if all(one.leaves(frame, sender) for one in later):
            self.queue(frame, sender)

    def queue(self, frame: Frame, sender: object) -> None:
        """Queue a frame whatever disturbs the sending."""
        self._queued += 1
        waiting = (frame.arbitration(), self._queued, frame, sender)
        if not self._transmitting:
            self._transmit(waiting)
            return
        heapq.heappush(self._pending, waiting)
        if len(self._pending) > _MOST_WAITING:
            self._shed()

    def _shed(self) -> None:
        """Lose the half that would win last."""
        self._pending.sort()  # a sorted list is a heap
        self.frames_lost += len(self._pending) - _MOST_WAITING // 2
        del self._pending[_MOST_WAITING // 2 :]

    def withdraw(self, sender: object) -> None:
        """Drop a sender's frames after bus off: queued ones, and the one on the wire."""
        self._pending = [waiting for waiting in self._pending if waiting[3] is not sender]
        heapq.heapify(self._pending)
        if self._on_wire is not None and self._on_wire[3] is sender:
            self._on_wire = None

    def _transmit(self, waiting: _Waiting) -> None:
        self._on_wire = waiting
        self._transmitting = True
        _, _, frame, sender = waiting
        bits, end = _BITS[frame.extended][len(frame.data)], self._finish
        if self.disturbances and not all(one.survives(frame, sender) for one in self.disturbances):
            bits, end = bits / 2 + _ERROR_FRAME_BITS, self._destroy
        duration_ns = round(bits * SECOND_NS / self.bitrate)
        self.busy_ns += duration_ns
        clock = self.clock
        clock.at(clock.now_ns if self.carries_at_once else clock.now_ns + duration_ns, end)

    def _finish(self) -> None:
        if self._on_wire is not None:
            _, _, frame, sender = self._on_wire
            self.deliver(frame, sender)
        self._release()

    def deliver(self, frame: Frame, sender: object) -> None:
        """Deliver a frame to every receiver but its sender."""
        self.frames_carried += 1
        key = _EXTENDED_ROUTE if frame.extended else frame.cob_id
        disturbances = self.disturbances
        for participant, receive in self._routes.get(key) or self._route(key):
            if participant is not sender and (not disturbances or self._reaches(frame, sender, participant)):
                receive(frame, sender)

    def _route(self, key: int) -> tuple[tuple[object, Receiver], ...]:
        """Find the receivers of an identifier; once, until a participant or filter changes."""
        filters = self._filters
        route = self._routes[key] = tuple(
            (participant, receive)
            for participant, receive in self._receivers.items()
            if participant not in filters or key in filters[participant]
        )
        return route

    def _reaches(self, frame: Frame, sender: object, receiver: object) -> bool:
        return all(disturbance.arrives(frame, sender, receiver) for disturbance in self.disturbances)

    def tell_error(self, error_class: int = BUS_ERROR) -> None:
        """Tell of an error frame on the wire, or of a new state of an interface's controller."""
        for on_error in tuple(self._error_listeners.values()):
            on_error(error_class)

    def _destroy(self) -> None:
        self.tell_error()
        if self._on_wire is not None:
            heapq.heappush(self._pending, self._on_wire)
        self._release()

    def _release(self) -> None:
        if self._pending:
            self._transmit(heapq.heappop(self._pending))
        else:
            self._transmitting, self._on_wire = False, None
