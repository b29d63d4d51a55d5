"""The simulated CAN bus: frames wait, arbitrate by identifier, and take their time at the bit rate."""

import heapq
from collections.abc import Callable
from dataclasses import dataclass

from hil_sim.clock import SECOND_NS, Clock

# ISO 11898-1: a data frame with an 11-bit identifier has 44 bits and its data, and 3 of intermission follow;
# 18 more with a 29-bit identifier. Stuff bits depend on the content; this share of the stuffable bits is what
# drive traffic shows on average (8 bytes: 118.25 bits in all, 8457 frames/s at 1 Mbit/s).
_FRAME_BITS = 47
_EXTENDED_BITS = 18
_STUFFABLE_BITS = 34
_STUFFING = 0.074


@dataclass(frozen=True, slots=True)
class Frame:
    """One CAN frame; `cob_id` is the identifier, `data` 0 to 8 bytes (none in a remote frame)."""

    cob_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False

    def bits(self) -> float:
        """Length on the wire, intermission and average stuffing included."""
        content = 8 * len(self.data) + (_EXTENDED_BITS if self.extended else 0)
        return _FRAME_BITS + content + _STUFFING * (_STUFFABLE_BITS + content)

    def arbitration(self) -> int:
        """The lower number wins the bus: a standard frame beats an extended one with the same first bits."""
        base = self.cob_id if self.extended else self.cob_id << 18
        return base << 2 | self.extended << 1 | self.remote


Receiver = Callable[[Frame, object], None]


class CanBus:
    """A bus that carries one frame at a time.

    A frame reaches every receiver but its sender, in the order in which frames win arbitration, at the moment
    its last bit is over. Receivers get the frame and who sent it.
    """

    def __init__(self, clock: Clock, bitrate: int = 1_000_000) -> None:
        self.clock = clock
        self.bitrate = bitrate
        self.frames_carried = 0
        self.busy_ns = 0
        self._receivers: dict[object, Receiver] = {}
        self._pending: list[tuple[int, int, Frame, object]] = []
        self._queued = 0
        self._transmitting = False

    def attach(self, participant: object, receive: Receiver) -> None:
        self._receivers[participant] = receive

    def detach(self, participant: object) -> None:
        self._receivers.pop(participant, None)

    @property
    def pending(self) -> int:
        """Frames that wait for the bus."""
        return len(self._pending)

    def send(self, frame: Frame, sender: object) -> None:
        """Queue a frame; it goes out when it wins the bus."""
        self._queued += 1
        heapq.heappush(self._pending, (frame.arbitration(), self._queued, frame, sender))
        if not self._transmitting:
            self._start_next()

    def _start_next(self) -> None:
        _, _, frame, sender = heapq.heappop(self._pending)
        duration_ns = round(frame.bits() * SECOND_NS / self.bitrate)
        self.busy_ns += duration_ns
        self._transmitting = True
        self.clock.after(duration_ns, lambda: self._finish(frame, sender))

    def _finish(self, frame: Frame, sender: object) -> None:
        self.frames_carried += 1
        for participant, receive in tuple(self._receivers.items()):
            if participant is not sender:
                receive(frame, sender)
        self._transmitting = False
        if self._pending:
            self._start_next()
