"""The plain list of what was handed in, and of what is known to have become of it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, TypeVar


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
    life: int = 0  # of the server
    at_ns: int = 0  # when, by a clock that nobody sets
    walls_ns: tuple[int, ...] = ()  # what the server's clock has added to that in this life; the last one did
    kept_ns: int = 0  # when it was dealt with
    turn: int = 0  # with which turn of the recorder
    batch: int = 0  # which file of the spool it is in; 0 where there is no such file any more
    harmed: bool = False  # somebody has damaged that file

    @property
    def sure(self) -> bool:
        """Whether it was acknowledged, and nobody has touched it since."""
        return self.fate is Fate.SAFE and not self.harmed


@dataclass(eq=False, slots=True)
class Row(Thing):
    """A row of telemetry; `angle` is in `unit`, None where the robot or the stream had no value."""

    link: tuple[str, str, int] = ("", "", 0)  # server, robot, and which connection
    stream: int = 0
    seq: int = 0
    place: int = 0
    stamp_ns: int = 0
    true_ns: int = 0  # when, by a clock that nobody sets
    late_ns: int = 0  # after that, its time: of a robot that nobody can ask for its clock
    unit: str | None = None
    angle: float | None = None
    ratio: float | None = None

    def utc_ns(self, wall_ns: int) -> int:
        """Its time where the server's clock adds so much, as the store keeps it."""
        return (self.true_ns + wall_ns + self.late_ns) // 1000 * 1000


@dataclass(eq=False, slots=True)
class Begun(Thing):
    """That a session has begun."""


@dataclass(eq=False, slots=True)
class Over(Thing):
    """That a session is over."""


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
class Asked(Thing):
    """The tail of a robot's journal, from this entry to that."""

    first: int = 0
    last: int = 0


@dataclass(eq=False, slots=True)
class Bad(Thing):
    """What a robot sent and nobody can keep: of a robot the first one has an event."""


@dataclass(eq=False, slots=True)
class Loss:
    """So many of these rows were counted as lost by a server; `told` once an event of it is safe."""

    server: str
    life: int
    writer: str  # what that life is called at the store
    rows: int
    things: list[Thing]
    since_ns: int = 0  # the turn before
    told: bool = False
    told_ns: int = 0  # when
    walls_ns: tuple[int, ...] = ()  # what the server's clock has added in this life until then
    batch: int = 0  # and in which file of the spool
    harmed: bool = False  # which somebody has damaged


Kind = TypeVar("Kind", bound=Thing)


@dataclass(slots=True)
class Ledger:
    """Everything that was handed in."""

    things: list[Thing] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)

    def rows(self) -> Iterator[Row]:
        return self.all_of(Row)

    def all_of(self, kind: type[Kind]) -> Iterator[Kind]:
        """Everything of this kind, in the order in which it was handed in."""
        return (thing for thing in self.things if isinstance(thing, kind))

    def harm(self, server: str, batch: int) -> None:
        """Somebody damages this file of a server's spool."""
        found: list[Thing | Loss] = [*self.things, *self.losses]
        for each in found:
            each.harmed |= (each.server, each.batch) == (server, batch)


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
