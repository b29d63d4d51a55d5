"""The recorder: takes everything from the network's thread at once, and puts it into the spool in its own."""

import functools
import logging
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final, NamedTuple, Self

from gateway.client import Batch
from gateway.wire.control import SignedHead
from gateway.wire.resource import ResourceSnapshot
from gateway.wire.robot import Description
from ml.store.tables import EVENTS, LABELS, SESSIONS, TABLES, TELEMETRY
from server_gui.core.recording import records
from server_gui.core.recording.batching import EventKind, Notification
from server_gui.core.recording.clocks import ClockReading, Moment
from server_gui.core.recording.errors import NotKept, SpoolUnusable
from server_gui.core.recording.journal_tail import Entry
from server_gui.core.recording.losses import Losses, Part
from server_gui.core.recording.records import Facts
from server_gui.core.recording.robots import Robots
from server_gui.core.recording.rows import Record, Run
from server_gui.core.recording.spool import Spool
from server_gui.core.threads.supervision import BEAT_S, Worker

log = logging.getLogger(__name__)

CONTROL: Final = frozenset({SESSIONS.name, LABELS.name, EVENTS.name})  # few, and what rows are told apart by
SHARES: Final = 2  # of several robots, one may have this part of what waits: its flood leaves the others room
COMMIT_S: Final = 0.05  # rows of so long go to the disk together
HELD_S: Final = 60.0  # that a mistake of ours stays an alarm, so that it is seen
AGAIN_S: Final = 1.0  # between attempts on a disk that refuses, and looks at how full it is
LAST_S: Final = 10.0  # at the end, that a disk which refuses is tried again; then what waits is lost

Work = Callable[[], Iterable[Record]]


class Item(NamedTuple):
    """Something handed in: how many rows of which robot, and what makes records of it."""

    robot: str
    rows: int
    work: Work


class AlarmKind(Enum):
    """Kind of trouble that keeps the recorder from recording everything."""

    OVERFLOW = "overflow"  # rows came faster than the disk takes them
    DISK_FULL = "disk_full"  # recording has stopped until there is room
    UNCLEARED = (
        "uncleared"  # nobody can say or see to it that the disk has room; it goes on as long as it has
    )
    SPOOL_FAILED = "spool_failed"  # the spool cannot be written; what waits is tried again
    UNFROZEN = "unfrozen"  # no new file can be begun: what comes is kept in the old one, and goes nowhere
    BROKEN = "broken"  # a mistake of ours: what was to be kept then is lost; it goes on


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm, in words; raised once when it begins."""

    kind: AlarmKind
    text: str


@dataclass(frozen=True, slots=True)
class RecorderState:
    """State of recording: rows since the start, and the present alarms."""

    recorded: int
    waiting: int
    lost: int
    commit_s: float  # how long the newest commit took
    alarms: tuple[Alarm, ...]


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """Settings of the recorder; a batch goes to the store at this age or length."""

    capacity: int = 50_000  # rows that may wait for the disk: of 60 channels they take half a gigabyte
    batch_s: float = 60.0
    batch_rows: int = 200_000


class Recorder:
    """Keeps every robot's data; use it as a context manager, which joins its thread.

    What hands something in returns at once, whatever the disk does, and is called from any one thread. It
    gives a number; when `acknowledged` has reached it, that item is on the disk and survives any crash,
    unless it was counted in `state.lost`, which raises an alarm and is recorded as an event.
    """

    def __init__(
        self,
        spool: Spool,
        on_alarm: Callable[[Alarm], None] | None = None,
        settings: RecorderSettings | None = None,
    ) -> None:
        self._spool = spool
        self._on_alarm = on_alarm
        self._settings = settings or RecorderSettings()
        self.worker = Worker("recorder", self._run)
        # Shared between the threads, under the lock.
        self._changed = threading.Condition()
        self._queue: list[Item] = []
        self._queued_rows = 0
        self._handed = 0
        self._acknowledged = 0
        self._overflowed: Counter[str] = Counter()  # rows that found no room, of each robot
        self._waiting: Counter[str] = Counter()  # rows that wait, of each robot
        self._senders: set[str] = set()  # robots that have sent something
        self._ending = threading.Event()
        self._until_s = 0.0  # how long a disk is tried at the end
        # The recorder's thread.
        self._robots = Robots(spool.heads)
        self._alarms: dict[AlarmKind, Alarm] = {}
        self._recorded = 0
        self._lost = 0
        self._untold = Losses()  # that no event tells yet
        self._sessions_lost = False  # rows of sessions may be among what was lost: they are written again
        self._commit_s = 0.0
        self._looked_s = -AGAIN_S
        self._broke_s = -HELD_S
        self._roomy = True
        self._cuts: list[Callable[[], None]] = []

    def __enter__(self) -> Self:
        self.worker.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """End every session, put what waits into the spool, freeze it, and join the thread. Idempotent.

        A disk that refuses is tried again for `LAST_S`; what is lost then is named in the log.
        """
        with self._changed:
            if not self._ending.is_set():
                self._until_s = time.monotonic() + LAST_S
            self._ending.set()
            self._changed.notify_all()
        self.worker.join()

    # --- what is handed in

    def record(self, robot: str, stream: int, batch: Batch, clock_offset_ns: int | None = None) -> int:
        """Keep a notification. `clock_offset_ns` is the robot's monotonic clock minus ours, where known."""
        robot_ns = clock_offset_ns
        if robot_ns is None:  # then the newest row is taken to have come without delay
            newest_ns = batch.stamps_ns[-1] if batch.stamps_ns else batch.received_ns
            robot_ns = newest_ns - batch.received_ns
        clocks = ClockReading(Moment.now().to_utc_ns, robot_ns, known=clock_offset_ns is not None)
        new = Notification(stream, batch, clocks)
        return self._put(robot, len(batch.stamps_ns), functools.partial(self._robots.take, robot, new))

    def describe(self, robot: str, description: Description) -> int:
        """Take the channels' units; a name that differs from `robot`, or is another's too, is an event."""
        work = functools.partial(self._robots.describe, robot, description, Moment.now())
        return self._put(robot, 1, work, control=True)

    def begin(self, robot: str, facts: Facts) -> str:
        """Begin a session, end the one before, and give its name. The first row begins one where none is."""
        session = records.begin(robot, facts)
        self._put(robot, 1, functools.partial(self._robots.begin, session), control=True)
        return session.name

    def amend(self, robot: str, facts: Facts) -> int:
        """Say more about the robot's session than was known when it began."""
        return self._put(robot, 1, functools.partial(self._robots.amend, robot, facts), control=True)

    def end(self, robot: str) -> int:
        """End the robot's session: nobody wants it recorded, until it begins again."""
        return self._put(robot, 1, functools.partial(self._robots.rest, robot, Moment.now()), control=True)

    def leave(self, robot: str) -> int:
        """End the robot's session; it is followed no more."""
        return self._put(robot, 1, functools.partial(self._robots.leave, robot, Moment.now()), control=True)

    def resources(self, robot: str, snapshot: ResourceSnapshot) -> int:
        """Keep a look at the robot's computer."""
        return self._put(robot, 1, functools.partial(self._robots.resources, robot, Moment.now(), snapshot))

    def journal(self, robot: str, entries: Sequence[Entry], head: SignedHead | None = None) -> int:
        """Record the new entries in a tail of the robot's journal; `head` is one of them, signed."""
        work = functools.partial(self._robots.journal, robot, entries, Moment.now(), head)
        return self._put(robot, len(entries), work)

    def refused(self, robot: str, what: str, why: str) -> int:
        """Record that the robot sent unusable data, once for each `what`."""
        return self._put(robot, 1, functools.partial(self._robots.refused, robot, what, why))

    def mark(self, robot: str, text: str, ago_s: float = 0.0, **data: Any) -> int:
        """Mark this instant, or the one `ago_s` before it."""
        return self._event(robot, EventKind.MARKER, text, Moment.now().before(ago_s), data)

    def event(self, robot: str, kind: EventKind, text: str, **data: Any) -> int:
        """Record an event of the robot now."""
        return self._event(robot, kind, text, Moment.now(), data)

    def _event(self, robot: str, kind: EventKind, text: str, moment: Moment, data: Mapping[str, Any]) -> int:
        return self._put(
            robot, 1, lambda: [self._robots.known(robot).now(kind, text, moment, **data)], control=True
        )

    def add(self, *added: Record) -> int:
        """Keep rows of any tables: labels, predictions.

        Raises:
            ValueError: there is no such table, or one is no row of it; none is kept then.

        """
        _check(added)
        control = {record.table for record in added} <= CONTROL
        robot = added[0].fields.get("robot", "")
        return self._put(robot, len(added), lambda: map(self._robots.timed, added), control=control)

    def cut(self, then: Callable[[], None]) -> int:
        """End the batch with what was handed in until now; `then` is called when it waits for upload."""

        def work() -> Iterable[Record]:
            self._cuts.append(then)
            return ()

        return self._put("", 0, work)

    # --- how it goes

    @property
    def acknowledged(self) -> int:
        """The newest number up to which everything handed in has been dealt with."""
        return self._acknowledged

    @property
    def state(self) -> RecorderState:
        """How recording goes now."""
        alarms = tuple(self._alarms.copy().values())
        lost = self._lost + self._overflowed.total()
        return RecorderState(self._recorded, self._queued_rows, lost, self._commit_s, alarms)

    @property
    def untold(self) -> int:
        """Number of lost rows without an event; for its end."""
        return self._untold.rows

    def flush(self, timeout_s: float) -> bool:
        """Wait until everything handed in until now has been dealt with; False where that took too long."""
        with self._changed:
            wanted = self._handed
            return self._changed.wait_for(lambda: self._acknowledged >= wanted, timeout_s)

    def _put(self, robot: str, rows: int, work: Work, *, control: bool = False) -> int:
        """Let it wait for the disk, where there is room; what rows are told apart by (`control`) always."""
        with self._changed:
            self._handed += 1
            capacity, own = self._settings.capacity, self._waiting[robot] + rows
            self._senders.add(robot)
            share = capacity if len(self._senders) == 1 else capacity // SHARES
            if not control and (self._queued_rows + rows > capacity or own > share):
                self._overflowed[robot] += rows
            else:
                self._queued_rows += rows
                self._waiting[robot] = own
                self._queue.append(Item(robot, rows, work))
            self._changed.notify_all()
            return self._handed

    # --- the recorder's thread

    def _run(self) -> None:
        ending = False
        while not ending:
            queue, handed, ending = self._next()
            try:
                self._turn(queue, ending)
            except BaseException as error:
                self._count((item.robot, item.rows) for item in queue)
                self._write_again()
                self._break(error)
                if not isinstance(error, Exception):
                    raise
                log.exception("internal error of the recorder; it goes on")
            if time.monotonic() - self._broke_s > HELD_S:
                self._alarm(AlarmKind.BROKEN, None)
            with self._changed:
                self._acknowledged = handed
                self._changed.notify_all()

    def _break(self, error: BaseException) -> None:
        """Count rows lost by an internal error."""
        self._broke_s = time.monotonic()
        text = f"rows were lost by an internal error of the recorder, {type(error).__name__}: see its log"
        self._alarm(AlarmKind.BROKEN, text)

    def _turn(self, queue: Sequence[Item], ending: bool) -> None:
        found = [record for item in queue for record in self._done(item)]
        if ending:
            found += self._robots.end_all()
        self._keep(found)
        self._freeze(ending)

    def _next(self) -> tuple[list[Item], int, bool]:
        """Wait until there is something to keep, let more come, and take it all."""
        with self._changed:
            self.worker.beat()
            self._changed.wait_for(lambda: self._ending.is_set() or self._acknowledged < self._handed, BEAT_S)
        self._ending.wait(COMMIT_S)
        self.worker.beat()
        with self._changed:
            queue, self._queue = self._queue, []
            self._queued_rows = 0
            self._waiting.clear()
            overflowed, self._overflowed = self._overflowed, Counter()
            self._count(overflowed.items())
            handed, ending = self._handed, self._ending.is_set()
        self._alarm(
            AlarmKind.OVERFLOW,
            f"{overflowed.total()} rows were lost: the disk takes them more slowly than they come"
            if overflowed
            else None,
        )
        return queue, handed, ending

    def _done(self, item: Item) -> list[Record]:
        """Return the records that an item makes; what a robot sends wrongly disturbs no other robot."""
        try:
            found = list(item.work())
            _check(found)
        except Exception as error:  # noqa: BLE001 - whatever it is, the others' recording goes on
            self._lost += item.rows
            return self._robots.refused(item.robot, "", str(error))
        return found

    def _keep(self, found: list[Record]) -> None:
        runs = self._robots.runs()
        if not self._has_room():
            self._lose([*runs, *found])
            if self._ending.is_set():
                self._give_up(f"the disk of {self._spool.folder} is nearly full")
            return
        untold, self._untold = self._untold, Losses()
        for robot, lost, text in untold.robots():
            found += self._robots.lost(robot, lost, text)
        if self._sessions_lost:
            found = [*self._robots.sessions(), *found]
            self._sessions_lost = False
        parts: list[Part] = [*runs, *found]
        left: list[list[Part]] = [[*parts, *self._robots.heads.items()]] if parts else []
        while left:
            now = left.pop()
            try:
                self._append(now)
            except NotKept as error:
                half = len(now) // 2
                if half:  # what the spool does not take is looked for, so that only that is lost
                    left += [now[half:], now[:half]]
                else:
                    self._not_kept(now[0], error)
            except SpoolUnusable as error:
                self._alarm(AlarmKind.SPOOL_FAILED, str(error))
                left.append(now)
                if self._gives_up_within(AGAIN_S):
                    self._untold.join(untold)
                    self._lose([part for parts in left for part in parts])
                    self._give_up(str(error))
                    return

    def _gives_up_within(self, wait_s: float) -> bool:
        """Wait so long, and say that this is no standing still; True where the end has come and is over."""
        until_s = time.monotonic() + wait_s
        while not self._ending.is_set() and (left_s := until_s - time.monotonic()) > 0:
            self._ending.wait(min(left_s, BEAT_S))
            self.worker.beat()
        if not self._ending.is_set():
            return False
        time.sleep(min(wait_s, BEAT_S))  # between attempts on a disk: nobody else can say when it is well
        self.worker.beat()
        return time.monotonic() >= self._until_s

    def _give_up(self, why: str) -> None:
        """Log losses at the end, which no event can record any more."""
        for text in self._untold.lines():
            log.error("%s; lost: %s", why, text)

    def _append(self, parts: Sequence[Part]) -> None:
        """Commit these together; raises as `Spool.append` does, and nothing of them is kept then."""
        runs = [part for part in parts if isinstance(part, Run)]
        found = [part for part in parts if isinstance(part, Record)]
        heads = dict(part for part in parts if isinstance(part, tuple))
        began_s = time.monotonic()
        self._spool.append(runs, found, heads)
        self._commit_s = time.monotonic() - began_s
        self._recorded += sum(map(_rows, parts))
        self._alarm(AlarmKind.SPOOL_FAILED, None)

    def _not_kept(self, part: Part, error: NotKept) -> None:
        """Give up one part, which no disk would take; its robot's journal is begun anew where it was that."""
        robot = part[0] if isinstance(part, tuple) else getattr(part, "robot", "")
        log.error("internal error: %s; of %s, and lost", error, robot or "no robot")
        if isinstance(part, tuple):
            self._robots.forget(part[0], self._spool.heads)
        self._lost += _rows(part)
        self._untold.add([part])
        self._sessions_lost = True
        self._break(error)

    def _count(self, lost: Iterable[tuple[str, int]]) -> None:
        """Count so many lost rows of each robot, of which nobody knows more."""
        now_ns = Moment.now().utc_ns
        for robot, rows in lost:
            self._lost += rows
            self._untold.count(robot, rows, now_ns)

    def _lose(self, parts: Sequence[Part]) -> None:
        self._lost += sum(map(_rows, parts))
        self._untold.add(parts)
        self._write_again()

    def _write_again(self) -> None:
        """Write again after a loss what may have been among it, and what is said once."""
        self._sessions_lost = True
        self._robots.heads = dict(self._spool.heads)  # those entries are still to be seen

    def _has_room(self) -> bool:
        now_s = time.monotonic()
        if now_s - self._looked_s >= AGAIN_S:
            self._looked_s = now_s
            try:
                self._roomy, uncleared = self._spool.make_room(), None
            except SpoolUnusable as error:  # a commit that finds none says so itself
                self._roomy, uncleared = True, f"{error}; what was uploaded stays in it"
            full = f"recording has stopped: the disk of {self._spool.folder} is nearly full; make room there"
            self._alarm(AlarmKind.UNCLEARED, uncleared)
            self._alarm(AlarmKind.DISK_FULL, None if self._roomy else full)
        return self._roomy

    def _freeze(self, ending: bool) -> None:
        settings = self._settings
        is_full = self._spool.age_s >= settings.batch_s or self._spool.rows >= settings.batch_rows
        if not (ending or self._cuts or is_full):
            return
        try:
            self._spool.freeze()
        except SpoolUnusable as error:  # tried again with the next turn
            self._alarm(AlarmKind.UNFROZEN, f"{error}; what comes is kept in the file before it")
            return
        self._alarm(AlarmKind.UNFROZEN, None)
        cuts, self._cuts = self._cuts, []
        for then in cuts:
            then()

    def _alarm(self, kind: AlarmKind, text: str | None) -> None:
        """Begin an alarm, go on with it, or end it where there is nothing to say."""
        known = self._alarms.get(kind)
        if text is None:
            if known is not None:
                del self._alarms[kind]
                log.warning("no longer: %s", known.text)
            return
        self._alarms[kind] = Alarm(kind, text)
        if known is None:
            log.error("%s", text)
            if self._on_alarm is not None:
                self._on_alarm(self._alarms[kind])


def _rows(part: Part) -> int:
    """Return the number of rows in a part."""
    return len(part) if isinstance(part, Run) else int(isinstance(part, Record))


def _check(found: Sequence[Record]) -> None:
    """Refuse what the store would not take, with `ValueError`: telemetry comes in runs alone."""
    by_table: dict[str, list[Mapping[str, Any]]] = {}
    for record in found:
        by_table.setdefault(record.table, []).append(record.fields)
    for name, rows in by_table.items():
        if name not in TABLES or name == TELEMETRY.name:
            known = ", ".join(each for each in TABLES if each != TELEMETRY.name)
            raise ValueError(f"there is no table {name} that takes single rows; there are {known}")
        TABLES[name].rows(rows)
