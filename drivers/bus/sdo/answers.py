"""The responses of one SDO channel: fetched in their order, each assigned to the request that it answers."""

import contextlib
import queue
import time
from dataclasses import dataclass

from drivers.bus.sdo.duplicate_answers import DuplicateAnswers
from drivers.bus.sdo.outstanding import Outstanding
from drivers.bus.sdo.round_trips import RoundTrips
from drivers.inbox import Inbox

# Responses that wait. Of a flood the first are kept, in their order: what answers a request comes before what
# is sent behind it without being asked. What comes beyond is lost, which is as if it never came: its request
# stays outstanding.
INBOX = 64


@dataclass(slots=True)
class SdoCounters:
    """Counters of one channel."""

    transfers: int = 0
    timeouts: int = 0
    aborts: int = 0
    stale: int = 0  # responses that belonged to no request
    doubled: int = 0  # of these, second answers to one of the last requests
    resyncs: int = 0  # times that something else was read first, because an answer might have been late
    dropped: int = 0  # responses that nobody fetched in time


class Answers:
    """Put in by the bus's thread, fetched by that of the transfers."""

    def __init__(self, outstanding: Outstanding, counters: SdoCounters, round_trips: RoundTrips) -> None:
        self._outstanding = outstanding
        self._counters = counters
        self._round_trips = round_trips
        self._inbox: Inbox[tuple[int, bytes] | None] = Inbox()
        self._doubles = DuplicateAnswers()

    @property
    def doubled(self) -> bool:
        """Whether requests are answered twice, each of them."""
        return self._doubles.found

    @property
    def perhaps_doubled(self) -> bool:
        """Whether the last one was, and it must be seen whether the next are."""
        return self._doubles.suspected

    def forget_doubles(self) -> None:
        """They were another life's."""
        self._doubles = DuplicateAnswers()

    def put(self, stamp_ns: int, response: bytes) -> None:
        """Take a response."""
        if self._inbox.qsize() >= INBOX:
            self._counters.dropped += 1
        else:
            self._inbox.put((stamp_ns, response))

    def wake(self) -> None:
        """Let `fetch` return, as it does anyway where something waits for it."""
        if self._inbox.empty():
            self._inbox.put(None)

    def fetch_waiting(self) -> None:
        """Assign all that have come."""
        with contextlib.suppress(queue.Empty):
            while True:
                self._assign(self._inbox.get_nowait())

    def fetch(self, deadline: float) -> None:
        """Wait for the next one and assign it; raises `queue.Empty` at the deadline."""
        self._assign(self._inbox.get(timeout=max(0.0, deadline - time.monotonic())))

    def _assign(self, received: tuple[int, bytes] | None) -> None:
        if received is None:
            return
        stamp_ns, response = received
        request = self._outstanding.settle(response)
        if request is not None:
            self._round_trips.answered(request.sent_ns, stamp_ns, given_up=request.given_up)
            self._doubles.answered(response)
            return
        self._counters.stale += 1
        if not self._outstanding.is_lost(response):
            self._counters.doubled += self._doubles.again(response)
