"""Unanswered requests of one SDO channel, and their match with answers.

An answer names its object but not its request. A server answers in the order of the requests, and CAN keeps
the order of one identifier: so an answer is taken for that to the oldest request that it fits, and nothing
that was sent before that one is answered any more.
"""

import threading
import time
from collections.abc import Collection
from dataclasses import dataclass
from itertools import chain

from drivers.bus.sdo import protocol

MOST = 64  # requests whose order is remembered
# What every device may be asked without harm (CiA 301 §7.5.2): type, identity, error register, heartbeat.
PROBES = ((0x1000, 0), (0x1018, 1), (0x1001, 0), (0x1018, 2), (0x1017, 0))
_SPARE = tuple((0x1018, subindex) for subindex in range(5, 255))  # that it has none is an answer too


@dataclass(slots=True, eq=False)
class Request:
    """A request that was sent about an object (its `sdo.multiplexer`), and its answer once that came."""

    about: bytes
    frame: bytes
    sent_ns: int = 0  # when it was handed to the bus
    answer: bytes | None = None
    given_up: bool = False  # nobody waits for the answer any more


class Outstanding:
    """Requests in the order in which they were sent. For any thread.

    It does not grow while a node is silent: of what is older than the last `MOST` only the objects are kept.
    An answer about one of these settles nothing, because nobody can say to which request it is.
    """

    def __init__(self) -> None:
        self.heard = True  # something came since the last probe was chosen
        self._requests: list[Request] = []
        self._crowd: set[bytes] = set()  # what older requests are about
        self._late: bytes | None = (
            None  # what the last answer is about, where it came late: it may come twice
        )
        self._turn = 0
        self._lock = threading.Lock()

    def add(self, about: bytes, frame: bytes) -> Request:
        """Return a request that is sent now."""
        request = Request(about, frame, time.monotonic_ns())
        with self._lock:
            self._requests.append(request)
            if len(self._requests) > MOST:
                self._crowd.add(self._requests.pop(0).about)
        return request

    def drop(self, request: Request) -> None:
        """Note that it could not be sent."""
        with self._lock:
            if request in self._requests:
                self._requests.remove(request)

    def holds(self, about: bytes) -> bool:
        """Return whether an answer about this object may still come."""
        if not self._requests and self._late is None and not self._crowd:
            return False  # as a rule
        with self._lock:
            asked = any(request.about == about for request in self._requests)
            return asked or about in self._crowd or (self._late is not None and self._late[1:4] == about)

    def is_lost(self, answer: bytes) -> bool:
        """Return whether this may answer a request so old that nobody knows any more which."""
        with self._lock:
            return protocol.names_object(answer) and answer[1:4] in self._crowd

    def settle(self, answer: bytes) -> Request | None:
        """Take an answer; the request that it settles, `None` where it is none's or anybody's."""
        with self._lock:
            self.heard = True
            at = None if answer == self._late else self._answered_by(answer)
            if at is None:
                return None
            settled = self._requests[at]
            del self._requests[: at + 1]
            self._crowd.clear()
            self._late = answer if settled.given_up else None
            settled.answer = answer
            if self._requests:
                self._answer_repeated(settled, answer)
            return settled

    def forget(self) -> None:
        """Drop requests after a boot; the node may have got the newest one since."""
        with self._lock:
            del self._requests[:-1]
            self._crowd.clear()
            self._late = None

    def probe(self, avoid: bytes) -> tuple[int, int]:
        """Return another object than `avoid` to ask for, so that its answer settles what was asked before.

        One that is not asked for already, because its answer settles everything. A node that stays silent is
        asked for the same ones again: such objects are left for when it is heard.
        """
        with self._lock:
            usual = [one for one in PROBES if protocol.multiplexer(*one) != avoid]
            first = self._turn % len(usual)
            usual = [*usual[first:], *usual[:first]]
            self._turn += 1
            asked = {request.about for request in self._requests} | self._crowd
            spare: Collection[tuple[int, int]] = _SPARE if self.heard else ()
            self.heard = False
            fresh = (one for one in chain(usual, spare) if protocol.multiplexer(*one) not in asked)
            return next(fresh, usual[0])

    def _answered_by(self, answer: bytes) -> int | None:
        if answer[0] == protocol.ABORT and answer[1:4] == bytes(3):  # of anything: where it is one
            return 0 if len(self._requests) == 1 and not self._crowd else None
        if self._crowd and protocol.names_object(answer) and answer[1:4] in self._crowd:
            return None  # nobody knows to which
        for at, one in enumerate(self._requests):
            if protocol.answers(answer, one.frame, one.about):
                return at
        return None

    def _answer_repeated(self, settled: Request, answer: bytes) -> None:
        """Answer all repetitions of one write by this, if nothing else was written in between."""
        later = [one for one in self._requests if one.about == settled.about]
        if protocol.is_expedited_download(settled.frame) and all(one.frame == settled.frame for one in later):
            for one in later:
                one.answer = answer
