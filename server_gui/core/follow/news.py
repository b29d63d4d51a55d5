"""What happened, to any robot, newest first and bounded."""

import collections
import time
from dataclasses import dataclass
from enum import Enum
from typing import Final

KEPT: Final = 500


class NewsKind(Enum):
    """What sort of thing happened; the word is shown."""

    LINK = "LINK"
    STATE = "STATE"
    WARNING = "WARN"
    FAULT = "FAULT"
    PARAMETER = "PARAM"
    STOP = "STOP"
    CONTROL = "CONTROL"


@dataclass(frozen=True, slots=True)
class Item:
    """One thing that happened at `utc_s`."""

    utc_s: float
    kind: NewsKind
    robot: str
    text: str


class News:
    """The newest `KEPT`; `revision` rises with each."""

    def __init__(self) -> None:
        self.items: collections.deque[Item] = collections.deque(maxlen=KEPT)
        self.revision = 0

    def add(self, kind: NewsKind, robot: str, text: str) -> None:
        """Note something; the same of the same robot twice in a row is noted once."""
        if self.items and (self.items[0].kind, self.items[0].robot, self.items[0].text) == (
            kind,
            robot,
            text,
        ):
            return
        self.items.appendleft(Item(time.time(), kind, robot, text))
        self.revision += 1
