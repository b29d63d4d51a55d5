"""Whose parameters are read next: a few objects of a few devices at a time, in turn between the clients.

Everything that a robot offers is a thousand transfers on its buses, and a client may ask for it again and
again. So what is asked waits here as it was asked, and not as a thousand jobs before the devices: a write
never waits behind more than `OBJECTS` reads, a second client not for all that the first one wants, and the
buses and the interpreter have time for what must not be late.
"""

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from gateway.futures import done, outcome
from gateway.loop import Loop
from gateway.messages import ParameterValue, ParameterValues
from gateway.modules.parameters import Parameter
from gateway.turns import Client, Turns

DEVICES: Final = 2  # that are read at the same time
OBJECTS: Final = 8  # of one device in a row

Values = list[ParameterValue]
ReadSome = Callable[[Sequence[Parameter]], "Future[Values]"]


@dataclass(slots=True, eq=False)
class _Reading:
    """One request."""

    chosen: Sequence[Parameter]
    answer: "Future[ParameterValues]" = field(default_factory=Future)
    values: dict[str, ParameterValue] = field(default_factory=dict)
    _left: dict[str, deque[Parameter]] | None = None  # by device; only once it is this one's turn

    def free(self, busy: set[str]) -> str | None:
        """A device that is to be read, and is not being read."""
        return next((name for name, left in self._by_device().items() if left and name not in busy), None)

    def take(self, device: str) -> list[Parameter]:
        """What is to be read of it now."""
        left = self._by_device()[device]
        return [left.popleft() for _ in range(min(OBJECTS, len(left)))]

    def put(self, device: str, taken: Sequence[Parameter], values: Values) -> None:
        """The first so many of `taken` have these values; the others are still to be read."""
        self.values.update((one.name, value) for one, value in zip(taken, values, strict=False))
        self._by_device()[device].extendleft(reversed(taken[len(values) :]))

    @property
    def complete(self) -> bool:
        return len(self.values) == len(self.chosen)

    def finish(self) -> None:
        """Answer, in the order in which it was asked."""
        self.answer.set_result(ParameterValues({one.name: self.values[one.name] for one in self.chosen}))

    def _by_device(self) -> dict[str, deque[Parameter]]:
        if self._left is None:
            self._left = {}
            for one in self.chosen:
                self._left.setdefault(one.component, deque()).append(one)
        return self._left


class Reads:
    """One robot's. It belongs to the loop's thread.

    `read_some` reads these parameters of one device, in their order: all, or as many of the first as it
    could before it would have to wait too long, but at least one.
    """

    def __init__(self, loop: Loop, read_some: ReadSome) -> None:
        self._loop = loop
        self._read_some = read_some
        self._turns = Turns[_Reading]()
        self._busy: set[str] = set()  # devices

    def ask(self, client: Client, chosen: Sequence[Parameter]) -> "Future[ParameterValues]":
        """Read these, after what this client has asked for before."""
        if not chosen:
            return done(ParameterValues({}))
        reading = _Reading(chosen)
        self._turns.add(client, reading)
        self._go_on()
        return reading.answer

    def _go_on(self) -> None:
        while len(self._busy) < DEVICES:
            following = self._turns.next(lambda reading: reading.free(self._busy))
            if following is None:
                return
            self._begin(*following)

    def _begin(self, client: Client, reading: _Reading, device: str) -> None:
        taken = reading.take(device)
        self._busy.add(device)
        ended = partial(self._end, client, reading, device, taken)
        self._read_some(taken).add_done_callback(lambda found: self._loop.post(lambda: ended(found)))

    def _end(
        self,
        client: Client,
        reading: _Reading,
        device: str,
        taken: Sequence[Parameter],
        found: "Future[Values]",
    ) -> None:
        self._busy.discard(device)
        values = outcome(found)
        if isinstance(values, Exception):
            reading.answer.set_exception(values)
        else:
            reading.put(device, taken, values)
            if reading.complete:
                reading.finish()
        if reading.answer.done():
            self._turns.done(client, reading)
        self._go_on()
