"""Fair order of reads: a few objects of a few devices at a time, in turn between the clients.

Everything that a robot offers is a thousand transfers on its buses, and a client may ask for it again and
again. So what is asked waits here as it was asked, and not as a thousand jobs before the devices: a write
never waits behind more than `OBJECTS` reads, a second client not for all that the first one wants, and the
buses and the interpreter have time for what must not be late.
"""

import time
from collections import deque
from collections.abc import Callable, Container, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from typing import Final, Generic, Protocol, TypeVar

from gateway.connections.fair_queue import Client, FairQueue
from gateway.process.futures import done, outcome, then
from gateway.process.loop import Loop

DEVICES: Final = 2  # that are read at the same time; such as keep us waiting do not count
OBJECTS: Final = 8  # of one device in a row
SLOW_S: Final = 0.2  # a device that takes longer for these


class Named(Protocol):
    """An object to read: a parameter, or any other."""

    @property
    def name(self) -> str: ...


P = TypeVar("P", bound=Named)
V = TypeVar("V")  # what is told of each


@dataclass(slots=True, eq=False)
class _Reading(Generic[P, V]):
    """One request."""

    chosen: Sequence[P]
    device_of: Callable[[P], str]
    answer: "Future[dict[str, V]]" = field(default_factory=Future)
    values: dict[str, V] = field(default_factory=dict)
    _left: dict[str, deque[P]] | None = None  # by device; only once it is this one's turn

    def free(self, busy: Container[str]) -> str | None:
        """Return a device that is to be read, and is not being read."""
        return next((name for name, left in self._by_device().items() if left and name not in busy), None)

    def take(self, device: str) -> list[P]:
        """Return the parameters to be read now from a device."""
        left = self._by_device()[device]
        return [left.popleft() for _ in range(min(OBJECTS, len(left)))]

    def put(self, taken: Sequence[P], values: Sequence[V]) -> None:
        """Take values; when all are there, answer in the order of the request."""
        self.values.update((one.name, value) for one, value in zip(taken, values, strict=True))
        if len(self.values) == len(self.chosen) and not self.answer.done():
            self.answer.set_result({one.name: self.values[one.name] for one in self.chosen})

    def fail(self, error: Exception) -> None:
        if not self.answer.done():
            self.answer.set_exception(error)

    def _by_device(self) -> dict[str, deque[P]]:
        if self._left is None:
            self._left = {}
            for one in self.chosen:
                self._left.setdefault(self.device_of(one), deque()).append(one)
        return self._left


class Reads(Generic[P, V]):
    """One robot's. It belongs to the loop's thread. `read_all` reads these parameters of one device."""

    def __init__(
        self, loop: Loop, device_of: Callable[[P], str], read_all: "Callable[[Sequence[P]], Future[list[V]]]"
    ) -> None:
        self._loop = loop
        self._device_of = device_of
        self._read_all = read_all
        self._turns = FairQueue[_Reading[P, V]]()
        self._busy: dict[str, float] = {}  # devices, and since when
        self._slow: set[str] = set()

    def ask(self, client: Client, chosen: Sequence[P]) -> "Future[dict[str, V]]":
        """Read these, after what this client has asked for before."""
        if not chosen:
            return done({})
        reading = _Reading[P, V](chosen, self._device_of)
        self._turns.add(client, reading)
        self._go_on()
        return reading.answer

    def _go_on(self) -> None:
        while len(self._busy.keys() - self._slow) < DEVICES:
            following = self._turns.next(lambda reading: reading.free(self._busy))
            if following is None:
                return
            self._begin(*following)

    def _begin(self, client: Client, reading: _Reading[P, V], device: str) -> None:
        taken = reading.take(device)
        self._busy[device] = time.monotonic()
        ended = partial(self._end, client, reading, device, taken)
        values = then(done(taken), self._read_all)  # also where it raises
        values.add_done_callback(lambda found: self._loop.post(lambda: ended(found)))

    def _end(
        self,
        client: Client,
        reading: _Reading[P, V],
        device: str,
        taken: Sequence[P],
        found: "Future[list[V]]",
    ) -> None:
        is_slow = time.monotonic() - self._busy.pop(device) > SLOW_S
        (self._slow.add if is_slow else self._slow.discard)(device)
        values = outcome(found)
        if isinstance(values, Exception):
            reading.fail(values)
        else:
            reading.put(taken, values)
        if reading.answer.done():
            self._turns.done(client, reading)
        self._go_on()
