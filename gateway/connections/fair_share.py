"""Fair shares of a gateway's clients: the loop's time, and the memory for output that they have not read yet.

Requests are handled in turn: one of each address, one of each connection of an address, for as long as a
turn of the loop has time for that. So nobody waits for all that another one asks, however many times it has
connected.
"""

import logging
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

from gateway.process.loop import Loop
from gateway.wire.limits import OUTPUTS_BYTES

log = logging.getLogger(__name__)

COMPLAIN_S = 60.0  # between two lines of the log about one address and one matter …
COMPLAINTS = 256  # … and so many of them in that time, of all addresses
TURN_NS = 2_000_000  # what requests may take of one turn of the loop; the one that exceeds it is the last

Run = Callable[[], object]


class Holder(Protocol):
    """Whoever has answers waiting."""

    @property
    def peer(self) -> str: ...

    @property
    def waiting_bytes(self) -> int: ...

    def close(self) -> None: ...


class TimeSharing:
    """One loop's time: `turn_ns` of each of its turns. It belongs to the loop's thread."""

    def __init__(self, loop: Loop, turn_ns: int) -> None:
        self._loop = loop
        self._turn_ns = turn_ns
        self._waiting: dict[str, deque[Run]] = {}  # by address
        self._posted = False
        self._turn = -1
        self._until_ns = 0

    def take(self, address: str, run: Run) -> None:
        """Run it now, where nobody waits and this turn of the loop has time; else in turn."""
        if not self._waiting and self._has_time():
            run()
        else:
            self.add(address, run)

    def add(self, address: str, run: Run) -> None:
        """Run it in turn, in one of the loop's next turns."""
        self._waiting.setdefault(address, deque()).append(run)
        self._post()

    def _post(self) -> None:
        if not self._posted:
            self._posted = True
            self._loop.post(self._run)

    def _run(self) -> None:
        """One of each address after the other, and again, as long as there is time."""
        self._posted = False
        due = sum(map(len, self._waiting.values()))  # what these add is for the next turn
        while due and self._has_time():
            address = next(iter(self._waiting))
            runs = self._waiting.pop(address)
            run = runs.popleft()
            if runs:
                self._waiting[address] = runs  # behind the others
            due -= 1
            if self._waiting:
                self._post()  # before it, which may raise
            run()
        if self._waiting:
            self._post()

    def _has_time(self) -> bool:
        now_ns = time.monotonic_ns()
        if self._turn != self._loop.turns:
            self._turn, self._until_ns = self._loop.turns, now_ns + self._turn_ns
        return now_ns < self._until_ns


class FairShare(TimeSharing):
    """One gateway's. It belongs to the loop's thread."""

    def __init__(self, loop: Loop) -> None:
        super().__init__(loop, TURN_NS)
        self._bytes = 0
        self._holders: dict[Holder, None] = {}
        self._complaints: dict[tuple[str, str], float] = {}  # when they were made

    # The log

    def complain(self, address: str, what: str) -> None:
        """Put into the log what an address does that it should not; now and then, or that fills the disk."""
        now_s, about = time.monotonic(), (address, what)
        recent = {one: at_s for one, at_s in self._complaints.items() if now_s - at_s < COMPLAIN_S}
        if about not in recent and len(recent) < COMPLAINTS:
            log.warning("%s %s; said once in %.0f s", address, what, COMPLAIN_S)
            recent[about] = now_s
        self._complaints = recent

    # Memory

    def hold(self, holder: Holder, size: int) -> None:
        """Note that so many more bytes wait for this client; fewer, if it is negative."""
        self._bytes += size
        if holder.waiting_bytes:
            self._holders[holder] = None
        else:
            self._holders.pop(holder, None)
        if self._bytes > OUTPUTS_BYTES:
            self._loop.post(self._make_room)

    def _make_room(self) -> None:
        while self._bytes > OUTPUTS_BYTES:
            greediest = max(self._holders, key=lambda one: one.waiting_bytes)
            log.warning(
                "%s has %d bytes of answers waiting, the most of all; closed: all together have more than %d",
                greediest.peer,
                greediest.waiting_bytes,
                OUTPUTS_BYTES,
            )
            greediest.close()
