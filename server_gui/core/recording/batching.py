"""Gathering of robots' data into runs and events: pure, for the recorder's thread."""

import itertools
import uuid
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import msgspec
import numpy as np

from gateway.client import Batch
from server_gui.core.follow import validation
from server_gui.core.recording.clocks import Clock, ClockReading, ClockStep, Moment
from server_gui.core.recording.rows import Floats, Layout, Record, Run


class EventKind(Enum):
    """Kind of a recording's event."""

    GAP = "gap"  # something was not seen: the link dropped, or notifications never came
    DROPPED = "dropped"  # the robot threw rows away
    SHED = "shed"  # the robot sends one row of so many, to keep to its share of a core, or all of them again
    LOST = "lost"  # this server threw rows away: its queue or its disk was full
    LINK = "link"  # the link to the robot dropped
    NAME = "name"  # a robot calls itself by another name than the server's file, or by another robot's
    JOURNAL_GAP = "journal_gap"  # entries of the robot's journal were never seen
    REFUSED = "refused"  # a robot sent what cannot be kept
    MARKER = "marker"  # somebody marked this instant
    CLOCK_STEP = "clock_step"  # this server's clock was set, or the robot's moved: by how much, from and to
    FORGOTTEN = "forgotten"  # everything of a wearer was removed; who that was is a hash
    DANGER = "danger"  # advice or worse was foreseen, or was over, or was no longer known
    ADAPTED = "adapted"  # a model that was learned from the wearer's walk serves, or serves no more
    BUS = "bus"  # a bus of the robot failed, was full, or lacked what nodes send
    RULE = "rule"  # a rule on predictions began or ceased to hold, or what came of the stop that it asked for


Name = tuple[str, str, int, int]  # session, connection, stream, and which layout object


@dataclass(frozen=True, slots=True)
class Notification:
    """A batch of a stream, and how the clocks stood when it came."""

    stream: int
    batch: Batch
    clocks: ClockReading


Timed = tuple[Batch, int]  # and UTC minus the robot's monotonic clock


class Batching:
    """One robot's telemetry between two commits, and what its connection is called.

    The connection id is made here, anew for every link, so that a row is named once in the world whatever
    numbers a robot gives its streams after a restart.
    """

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self.session = ""
        self.connection = uuid.uuid4().hex[:16]
        self.units: dict[str, str] = {}
        self.clock = Clock()
        self._link: int | None = None
        self._newest: dict[int, tuple[int, int, int]] = {}  # by stream: its newest `seq`, `dropped`, `shed`
        self._rested: set[int] = set()  # streams of which nothing came since nobody wanted it recorded
        self._is_resting = False  # nothing of any stream has come since then
        self._gathered: dict[Name, tuple[Layout, list[Timed]]] = {}
        self._layouts: dict[tuple[str, ...], Layout] = {}

    def describe(self, units: dict[str, str]) -> None:
        """Take the channels' units from now on."""
        self.units = units
        self._layouts.clear()

    def take(self, new: Notification) -> list[Record]:
        """Keep one notification; the events that it tells of: a new link, a gap, rows dropped.

        Raises:
            Unfit: it cannot be kept, and is as if it had never come.

        """
        batch, layout = new.batch, self.check(new)
        self._go_on(new)
        before = (batch.seq - 1, batch.dropped, batch.shed)
        follows = batch.link == self._link and self._newest.get(new.stream) == before
        why = None if follows else self._why_new(new)
        if why is not None:
            self.clock.connection()  # which may be of another boot: no step of its clock
        steps = self.clock.steps(batch.received_ns, new.clocks)
        offset_ns = self.clock.take(new.stream, batch.stamps_ns, new.clocks)
        events = [] if follows and not steps else self._happened(new, why, steps, offset_ns)
        self._newest[new.stream] = (batch.seq, batch.dropped, batch.shed)
        self._is_resting = False
        if batch.stamps_ns:
            name = (self.session, self.connection, new.stream, id(layout))
            self._gathered.setdefault(name, (layout, []))[1].append((batch, offset_ns))
        return events

    def _go_on(self, new: Notification) -> None:
        """Count the first notification of a stream after a rest as the one that follows."""
        seq, _, shed = self._newest.get(new.stream, (-1, 0, 1))
        if new.stream in self._rested and new.batch.link == self._link:
            self._rested.discard(new.stream)
            if new.batch.seq > seq:  # else its numbers began anew
                self._newest[new.stream] = (new.batch.seq - 1, new.batch.dropped, shed)

    def rest(self) -> None:
        """Call nothing of what comes until the next `take` missing: nobody wants it recorded."""
        self._rested, self._is_resting = set(self._newest), True

    def check(self, new: Notification) -> Layout:
        """Return how its rows are laid out; raises as `take` would, and changes nothing."""
        channels = tuple(new.batch.columns)
        layout = self._layouts.get(channels) or self._layout(channels)
        _check(new)
        return layout

    def runs(self) -> list[Run]:
        """Everything gathered, and begin anew."""
        gathered, self._gathered = self._gathered, {}
        return [self._run(*name[:3], *found) for name, found in gathered.items()]

    def now(self, kind: EventKind, text: str, moment: Moment, **data: Any) -> Record:
        """As `event`, of an instant of ours."""
        return self.event(kind, text, self.clock.recorded_ns(moment), **data)

    def event(
        self, kind: EventKind, text: str, utc_ns: int, stamp_ns: int | None = None, **data: Any
    ) -> Record:
        """Something that happened to this robot or its recording; `data` is what JSON can say."""
        fields = {
            "robot": self.robot,
            "session": self.session,
            "utc": utc_ns,
            "stamp_ns": stamp_ns,
            "connection": self.connection,
            "kind": kind.value,
            "text": text,
            "data": msgspec.json.encode(data).decode(),
        }
        return Record("events", fields)

    def _why_new(self, new: Notification) -> str | None:
        """Return why a connection begins with this, if one does."""
        if new.batch.link != self._link:
            return "the link was made again"
        if new.batch.seq <= self._newest.get(new.stream, (-1, 0, 1))[0]:
            return "the stream's numbers began anew"
        return None

    def _happened(
        self, new: Notification, why: str | None, steps: Iterable[ClockStep], offset_ns: int
    ) -> list[Record]:
        """Return the events that a notification tells of."""
        batch, events = new.batch, []
        first_ns = batch.stamps_ns[0] if batch.stamps_ns else None
        came = Moment(batch.received_ns + new.clocks.to_utc_ns, new.clocks.to_utc_ns)
        utc_ns = self.clock.recorded_ns(came) if first_ns is None else first_ns + offset_ns

        def happened(kind: EventKind, text: str, **data: Any) -> None:
            events.append(self.event(kind, text, utc_ns, first_ns, stream=new.stream, seq=batch.seq, **data))

        if why is not None:
            self._new_connection(batch.link, why, happened)
        # Counted here: what waited too long for us behind the link is missing as well.
        newest, dropped, shed = self._newest.get(new.stream, (batch.seq - batch.missed - 1, 0, 1))
        missed, rows = batch.seq - newest - 1, batch.dropped - dropped
        if missed:
            happened(EventKind.GAP, _missing(missed, batch.missed), missed=missed)
        if rows > 0:
            happened(
                EventKind.DROPPED,
                f"the robot dropped {rows} rows: it was too busy, or we read too slowly",
                rows=rows,
            )
        if batch.shed != shed:
            share = (
                f"one row of {batch.shed}: more would be late, or beyond its max_cpu_percent"
                if batch.shed > 1
                else "every row"
            )
            happened(EventKind.SHED, f"the robot sends {share}", shed=batch.shed)
        for step in steps:
            data = {"whose": step.whose, "from": step.from_ns, "to": step.to_ns}
            happened(EventKind.CLOCK_STEP, str(step), **data)
        return events

    def _new_connection(self, link: int, why: str, happened: Callable[[EventKind, str], None]) -> None:
        if self._link is not None:
            self.connection = uuid.uuid4().hex[:16]
            if not self._is_resting:
                happened(EventKind.GAP, f"{why}; what was in between has not been seen")
        self._link = link
        self._newest.clear()
        self._rested.clear()

    def _layout(self, channels: tuple[str, ...]) -> Layout:
        for channel in channels:
            if not (channel and channel.isprintable()):
                raise validation.Unfit(f"{channel!r} is no name of a channel")
        layout = Layout(channels, tuple(self.units.get(channel) for channel in channels))
        return self._layouts.setdefault(channels, layout)

    def _run(
        self,
        session: str,
        connection: str,
        stream: int,
        layout: Layout,
        found: list[Timed],
    ) -> Run:
        batches = [batch for batch, _ in found]
        counts = [len(batch.stamps_ns) for batch in batches]
        stamps_ns = itertools.chain.from_iterable(batch.stamps_ns for batch in batches)
        return Run(
            self.robot,
            session,
            connection,
            stream,
            layout,
            stamps_ns=np.fromiter(stamps_ns, np.int64, sum(counts)),
            seqs=np.repeat(np.array([batch.seq for batch in batches], np.int64), counts),
            rows=np.concatenate([np.arange(count, dtype=np.int64) for count in counts]),
            utc_offset_ns=np.repeat(np.array([offset_ns for _, offset_ns in found], np.int64), counts),
            values=np.concatenate([_values(batch) for batch in batches], axis=1),
        )


def _missing(missed: int, on_the_link: int) -> str:
    """Return whose fault it is that notifications are missing: the window's header counts the link's."""
    if on_the_link >= missed:
        return f"{missed} notifications were lost on the link to the robot"
    came = (
        "all came"
        if not on_the_link
        else f"{on_the_link} were lost on the link to the robot, the others came"
    )
    return f"{missed} notifications were not recorded: {came}, but this computer was too busy to keep them"


def _check(new: Notification) -> None:
    """Refuse what would keep every robot's rows from being written."""
    validation.batch(new.stream, new.batch)
    if new.clocks.to_utc_ns - new.clocks.robot_ns not in validation.NUMBERS:
        raise validation.Unfit("the robot's clock is larger than 8 bytes hold")


def _values(batch: Batch) -> Floats:
    """Return a row a channel; None becomes NaN."""
    values = list(itertools.chain.from_iterable(batch.columns.values()))  # faster than array by array
    return np.array(values, np.float64).reshape(len(batch.columns), len(batch.stamps_ns))
