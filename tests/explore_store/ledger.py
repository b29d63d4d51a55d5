"""The plain list of what was handed in, and of what is known to have become of it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Any


class Fate(Enum):
    """What the server has said of it."""

    PENDING = "handed in, and nothing was said yet"
    SAFE = "acknowledged"
    OPEN = "the server ended before it said anything"
    COUNTED = "dealt with when some were counted as lost"


@dataclass(eq=False, slots=True)
class Thing:
    """Something that was handed in, of whom, and where it belongs."""

    number: int  # no two have the same
    server: str
    robot: str
    session: str
    fate: Fate = Fate.PENDING
    rows: int = 1


@dataclass(eq=False, slots=True)
class Row(Thing):
    """A row of telemetry; `angle` is in `unit`, None where the robot had no value."""

    link: tuple[str, str, int] = ("", "", 0)  # server, robot, and which connection
    seq: int = 0
    place: int = 0
    stamp_ns: int = 0
    true_ns: int = 0  # when, by a clock that nobody sets
    unit: str | None = None
    angle: float | None = None


@dataclass(eq=False, slots=True)
class Mark(Thing):
    """An event that somebody has marked."""


@dataclass(eq=False, slots=True)
class Said(Thing):
    """That a label holds, or holds no more."""

    label: str = ""
    began_ns: int = 0
    ended_ns: int = 0
    removed: bool = False


@dataclass(eq=False, slots=True)
class Amended(Thing):
    """A parameter of a session."""

    value: int = 0


@dataclass(eq=False, slots=True)
class Entry(Thing):
    """An entry of a robot's journal, seen by a server."""

    n: int = 0
    hash: str = ""


@dataclass(eq=False, slots=True)
class Loss:
    """So many of these rows were counted as lost by a server; `told` once an event of it is safe."""

    server: str
    life: int
    rows: int
    things: list[Thing]
    told: bool = False


@dataclass(slots=True)
class Ledger:
    """Everything that was handed in."""

    things: list[Thing] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)

    def rows(self) -> Iterator[Row]:
        return (thing for thing in self.things if isinstance(thing, Row))


@dataclass(frozen=True, slots=True)
class Promoted:
    """A model that was let serve a robot ("": every one) in the place of another ("": of none)."""

    robot: str
    model: str
    over: str


@dataclass(slots=True)
class Classes:
    """What was learned, and what was said of it."""

    trained: dict[int, tuple[str, str]] = field(default_factory=dict)  # by whom: model, and over which
    published: set[str] = field(default_factory=set)
    promoted: dict[str, Promoted] = field(default_factory=dict)  # by pointer
    written: list[tuple[str, str, str]] = field(default_factory=list)  # pointers, by whom, models
    meanwhile: Callable[[], None] | None = None  # what somebody else does just before the next pointer
    split: Any = None  # of the newest training
