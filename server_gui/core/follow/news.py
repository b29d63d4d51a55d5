"""News of all robots, newest first and bounded; repetitions are one item, faults are dropped last."""

import collections
import dataclasses
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

KEPT: Final = 500
AGAIN_S: Final = 60.0  # within which the same is a repeat
_NUMBER: Final = re.compile(r"\b\d+(\.\d+)?(?= ?(?:s|ms|%|°)(?:\W|$))")


class NewsKind(Enum):
    """Kind of news; the word is shown."""

    LINK = "LINK"
    STATE = "STATE"
    WARNING = "WARN"
    FAULT = "FAULT"
    LOST = "LOST"
    STALE = "STALE"
    PARAMETER = "PARAM"
    STOP = "STOP"
    NOT_STOPPED = "NOT STOPPED"
    RESET = "RESET"
    CONTROL = "CONTROL"


GRAVE: Final = frozenset({NewsKind.FAULT, NewsKind.STOP, NewsKind.NOT_STOPPED})
DONE: Final = frozenset(
    {NewsKind.PARAMETER, NewsKind.STOP, NewsKind.NOT_STOPPED, NewsKind.RESET, NewsKind.CONTROL}
)  # by people


@dataclass(frozen=True, slots=True)
class Item:
    """One thing that happened, at `utc_s` the last and at `first_s` the first of `count` times.

    `robot` is its name at the desk, which stays, or a part of this program.
    """

    utc_s: float
    kind: NewsKind
    robot: str
    text: str
    count: int = 1
    first_s: float | None = None
    about: str = ""  # a component, as alarms name it
    title: str = ""  # what people called the robot then; empty: it had not said its name yet
    key: tuple[NewsKind, str, str] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Find what repeats of it have in common: everything but the numbers in it."""
        whose, said = f"{self.robot} {self.title}", _NUMBER.sub("#", self.text)
        object.__setattr__(self, "key", (self.kind, whose, said))


class News:
    """The newest `KEPT`, of which faults and stops go last; `revision` rises with each."""

    def __init__(self) -> None:
        self.items: collections.deque[Item] = collections.deque()
        self.revision = 0

    def add(
        self, kind: NewsKind, robot: str, text: str, about: str = "", title: str = "", ago_s: float = 0.0
    ) -> None:
        """Note something that happened so long ago, in its place among the others.

        What is told again within a minute is counted, what has not changed is not told.
        """
        item = Item(time.time() - ago_s, kind, robot, text, about=about, title=title)
        is_deed = kind in DONE  # which is told each time
        if not is_deed and self.items and (self.items[0].key[:2], self.items[0].text) == (item.key[:2], text):
            return
        before = None if is_deed else next(self._lately(item), None)
        if before is not None:
            self.items.remove(before)
            first_s = before.utc_s if before.first_s is None else before.first_s
            item = dataclasses.replace(item, count=before.count + 1, first_s=first_s)
        newer = (place for place, one in enumerate(self.items) if one.utc_s <= item.utc_s)
        self.items.insert(next(newer, len(self.items)) if ago_s else 0, item)
        if len(self.items) > KEPT:
            self._forget_one()
        self.revision += 1

    def _lately(self, item: Item) -> Iterator[Item]:
        for known in self.items:
            if item.utc_s - known.utc_s > AGAIN_S:
                return
            if known.key == item.key:
                yield known

    def _forget_one(self) -> None:
        lightly = (place for place in range(len(self.items) - 1, -1, -1) if not self._is_grave(place))
        del self.items[next(lightly, len(self.items) - 1)]

    def _is_grave(self, place: int) -> bool:
        return self.items[place].kind in GRAVE
