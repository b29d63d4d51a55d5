"""Reads of devices' objects while they are visible: a few at a time, the oldest first.

Nothing is asked that nobody wants, one question is under way at a time, and `PERIOD_S` lies between two of
them, so that a page full of rows costs a node a fraction of its SDO channel.
"""

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from gateway.wire.dictionary import ObjectValue, ObjectValues
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.tuning.commands import Commands

PERIOD_S: Final = 0.25  # between two questions
AGAIN_S: Final = 1.0  # before the same object is asked for again
AFTER_FAILURE_S: Final = 2.0
MOST: Final = 24  # objects of one question
OLD_S: Final = 3.0  # a value that is older is not how it is now

Object = tuple[str, str]  # component, and address such as 0x6041:0


@dataclass(frozen=True, slots=True)
class ReadValue:
    """A device's answer, with the time of the request (our monotonic clock, and UTC for files)."""

    told: ObjectValue
    at_ns: int
    utc_s: float

    def age_s(self, now_ns: int) -> float:
        return max(0, now_ns - self.at_ns) / 1e9

    def is_old(self, now_ns: int) -> bool:
        return self.age_s(now_ns) > OLD_S


class Reading:
    """One robot's. For the window's thread."""

    def __init__(self, commands: Commands, deliver: Deliver) -> None:
        self._commands = commands
        self._deliver = deliver
        self.held: dict[Object, ReadValue] = {}
        self.problem: str | None = None  # why the latest question was not answered
        self.revision = 0
        self.left: dict[Object, None] = {}  # of those that are all to be read once
        self._asked: dict[Object, int] = {}
        self._is_asking = False
        self._next_ns = 0

    def look(self, wanted: Iterable[Object], still: Iterable[Object] = ()) -> None:
        """Ask for what is wanted most urgently, if it is time to; `still` is what never changes."""
        now_ns = time.monotonic_ns()
        if self._is_asking or now_ns < self._next_ns:
            return
        due = self._due(wanted, frozenset(still), now_ns) or list(self.left)
        if due:
            component = due[0][0]
            self._ask(component, [one for one in due if one[0] == component][:MOST], now_ns)

    def read_once(self, objects: Iterable[Object]) -> None:
        """Read all of these, as time allows; those that wait already are forgotten."""
        self.left = dict.fromkeys(objects)

    def forget(self, *, values: bool) -> None:
        """Forget the values of another link, or of another life of the robot's computer."""
        self.left.clear()
        self._asked.clear()
        self.problem = None
        if values:
            self.held.clear()
        self.revision += 1

    def _due(self, wanted: Iterable[Object], still: frozenset[Object], now_ns: int) -> list[Object]:
        due = [
            one
            for one in dict.fromkeys(wanted)
            if one not in self._asked or (one not in still and now_ns - self._asked[one] >= AGAIN_S * 1e9)
        ]
        return sorted(due, key=lambda one: self._asked.get(one, 0))

    def _ask(self, component: str, objects: Sequence[Object], now_ns: int) -> None:
        self._is_asking = True
        self._next_ns = now_ns + round(PERIOD_S * 1e9)
        utc_s = time.time()
        for one in objects:
            self._asked[one] = now_ns
        when_done(
            self._commands.read_objects(component, [address for _, address in objects]),
            self._deliver,
            lambda values: self._told(objects, values, now_ns, utc_s),
            lambda error: self._failed(objects, error),
        )

    def _told(self, objects: Sequence[Object], values: ObjectValues, at_ns: int, utc_s: float) -> None:
        self._is_asking = False
        self.problem = None
        self.revision += 1
        for one in objects:
            self.left.pop(one, None)
            told = values.values.get(one[1])
            if told is not None:
                self.held[one] = ReadValue(told, at_ns, utc_s)

    def _failed(self, objects: Sequence[Object], error: Exception) -> None:
        """Take a failure; values read before stay, with their age."""
        self._is_asking = False
        self.problem = str(error)
        self.revision += 1
        self._next_ns = time.monotonic_ns() + round(AFTER_FAILURE_S * 1e9)
        for one in objects:
            self._asked.pop(one, None)
