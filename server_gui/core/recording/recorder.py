"""The recorder: takes everything from the network's thread at once, and puts it into the spool in its own."""

import functools
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final, Self

from gateway.client import Batch
from gateway.messages import Description, ResourceSnapshot
from ml.store.tables import TABLES
from server_gui.core.recording import records
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.gathering import EventKind, Gathering, Notification
from server_gui.core.recording.journals import Entry, news
from server_gui.core.recording.records import Facts, Session
from server_gui.core.recording.rows import JournalHead, Record
from server_gui.core.recording.spool import Spool

COMMIT_S: Final = 0.05  # rows of so long go to the disk together
AGAIN_S: Final = 1.0  # between attempts on a disk that refuses, and looks at how full it is

Work = Callable[[], Iterable[Record]]


class AlarmKind(Enum):
    """What keeps the recorder from keeping everything."""

    OVERFLOW = "overflow"  # rows came faster than the disk takes them
    DISK_FULL = "disk_full"  # recording has stopped until there is room
    SPOOL_FAILED = "spool_failed"  # the spool cannot be written; what waits is tried again


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm, in words; raised once when it begins."""

    kind: AlarmKind
    text: str


@dataclass(frozen=True, slots=True)
class RecorderState:
    """How recording goes: rows since the start, and which alarms hold now."""

    recorded: int
    waiting: int
    lost: int
    commit_s: float  # how long the newest commit took
    alarms: tuple[Alarm, ...]


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """How the recorder behaves; a batch goes to the store when it is as old or as long as this."""

    capacity: int = 200_000  # rows that may wait for the disk
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
        self._thread = threading.Thread(target=self._run, name="recorder")
        # Shared between the threads, under the lock.
        self._changed = threading.Condition()
        self._queue: list[Work] = []
        self._queued_rows = 0
        self._handed = 0
        self._acknowledged = 0
        self._overflowed = 0
        self._ending = threading.Event()
        # The recorder's thread.
        self._robots: dict[str, Gathering] = {}
        self._sessions: dict[str, Session] = {}
        self._names: dict[str, str] = {}  # what robots call themselves → robot
        self._heads = dict(spool.heads)  # up to where journals are recorded, or about to be
        self._alarms: dict[AlarmKind, Alarm] = {}
        self._recorded = 0
        self._lost = 0
        self._lost_untold = 0
        self._commit_s = 0.0
        self._looked_s = -AGAIN_S
        self._roomy = True

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """End every session, put what waits into the spool, freeze it, and join the thread. Idempotent."""
        with self._changed:
            self._ending.set()
            self._changed.notify_all()
        if self._thread.ident is not None:
            self._thread.join()

    # --- what is handed in

    def record(self, robot: str, stream: int, batch: Batch, clock_offset_ns: int | None = None) -> int:
        """Keep a notification. `clock_offset_ns` is the robot's monotonic clock minus ours, where known."""
        to_utc_ns = time.time_ns() - time.monotonic_ns()
        if clock_offset_ns is None:  # then the newest row is taken to have come without delay
            newest_ns = batch.stamps_ns[-1] if batch.stamps_ns else batch.received_ns
            clock_offset_ns = newest_ns - batch.received_ns
        new = Notification(stream, batch, to_utc_ns - clock_offset_ns, batch.received_ns + to_utc_ns)
        return self._put(len(batch.stamps_ns), functools.partial(self._take, robot, new))

    def describe(self, robot: str, description: Description) -> int:
        """Take the channels' units; a name that differs from `robot`, or is another's too, is an event."""
        return self._put(1, functools.partial(self._describe, robot, description, time.time_ns()))

    def begin(self, robot: str, facts: Facts) -> str:
        """Begin a session, end the one before, and give its name. The first row begins one where none is."""
        session = records.begin(robot, facts)
        self._put(1, functools.partial(self._begin, session))
        return session.name

    def end(self, robot: str) -> int:
        """End the robot's session."""
        return self._put(1, functools.partial(self._end, robot))

    def resources(self, robot: str, snapshot: ResourceSnapshot) -> int:
        """Keep a look at the robot's computer."""
        utc_ns = time.time_ns()
        return self._put(1, lambda: [records.resources(robot, self._session(robot), utc_ns, snapshot)])

    def journal(self, robot: str, entries: Sequence[Entry]) -> int:
        """Keep what is new in a tail of the robot's journal."""
        return self._put(len(entries), functools.partial(self._journal, robot, entries, time.time_ns()))

    def mark(self, robot: str, text: str, **data: Any) -> int:
        """Mark this instant."""
        return self.event(robot, EventKind.MARKER, text, **data)

    def event(self, robot: str, kind: EventKind, text: str, **data: Any) -> int:
        """Keep that something happened to the robot now."""
        utc_ns = time.time_ns()
        return self._put(1, lambda: [self._known(robot).event(kind, text, utc_ns, **data)])

    def add(self, record: Record) -> int:
        """Keep a row of any table: a label, a prediction.

        Raises:
            ValueError: there is no such table, or this is no row of it.

        """
        if record.table not in TABLES:
            raise ValueError(f"there is no table {record.table}; there are {', '.join(TABLES)}")
        TABLES[record.table].rows([record.fields])  # what the store would not take is refused here
        return self._put(1, lambda: [record])

    # --- how it goes

    @property
    def acknowledged(self) -> int:
        """The newest number up to which everything handed in has been dealt with."""
        return self._acknowledged

    @property
    def state(self) -> RecorderState:
        """How recording goes now."""
        alarms = tuple(self._alarms.copy().values())
        lost = self._lost + self._overflowed
        return RecorderState(self._recorded, self._queued_rows, lost, self._commit_s, alarms)

    def flush(self, timeout_s: float) -> bool:
        """Wait until everything handed in until now has been dealt with; False where that took too long."""
        with self._changed:
            wanted = self._handed
            return self._changed.wait_for(lambda: self._acknowledged >= wanted, timeout_s)

    def _put(self, rows: int, work: Work) -> int:
        with self._changed:
            self._handed += 1
            if self._queued_rows + rows > self._settings.capacity:
                self._overflowed += rows
            else:
                self._queued_rows += rows
                self._queue.append(work)
            self._changed.notify_all()
            return self._handed

    # --- the recorder's thread

    def _run(self) -> None:
        ending = False
        while not ending:
            queue, handed, ending = self._next()
            found = [record for work in queue for record in work()]
            if ending:
                found += [record for robot in list(self._sessions) for record in self._end(robot)]
            self._keep(found)
            self._freeze(ending)
            with self._changed:
                self._acknowledged = handed
                self._changed.notify_all()

    def _next(self) -> tuple[list[Work], int, bool]:
        """Wait until there is something to keep, let more come, and take it all."""
        with self._changed:
            self._changed.wait_for(
                lambda: self._ending.is_set() or self._acknowledged < self._handed, AGAIN_S
            )
        self._ending.wait(COMMIT_S)
        with self._changed:
            queue, self._queue = self._queue, []
            self._queued_rows = 0
            self._lost_untold += self._overflowed
            self._lost += self._overflowed
            overflowed, self._overflowed = self._overflowed, 0
            handed, ending = self._handed, self._ending.is_set()
        self._alarm(
            AlarmKind.OVERFLOW,
            f"{overflowed} rows were lost: the disk takes them more slowly than they come"
            if overflowed
            else None,
        )
        return queue, handed, ending

    def _keep(self, found: list[Record]) -> None:
        runs = [run for robot in self._robots.values() for run in robot.runs()]
        rows = sum(map(len, runs)) + len(found)
        if not self._has_room():
            self._lose(rows)
            return
        found += self._losses()
        while runs or found:
            try:
                began_s = time.monotonic()
                self._spool.append(runs, found, self._heads)
            except SpoolUnusable as error:
                self._alarm(AlarmKind.SPOOL_FAILED, str(error))
                if not self._ending.wait(AGAIN_S):
                    continue
                self._lose(rows)
                return
            self._commit_s = time.monotonic() - began_s
            self._recorded += rows
            self._alarm(AlarmKind.SPOOL_FAILED, None)
            return

    def _lose(self, rows: int) -> None:
        self._lost += rows
        self._lost_untold += rows
        self._heads = dict(self._spool.heads)  # those entries are still to be seen

    def _losses(self) -> list[Record]:
        """That rows were lost here, told in the recording of every robot there is."""
        lost, self._lost_untold = self._lost_untold, 0
        if not lost:
            return []
        text = f"this server lost {lost} rows of all its robots"
        now_ns = time.time_ns()
        return [robot.event(EventKind.LOST, text, now_ns, rows=lost) for robot in self._robots.values()]

    def _has_room(self) -> bool:
        now_s = time.monotonic()
        if now_s - self._looked_s >= AGAIN_S:
            self._looked_s = now_s
            self._roomy = self._spool.make_room()
            full = f"recording has stopped: the disk of {self._spool.folder} is nearly full; make room there"
            self._alarm(AlarmKind.DISK_FULL, None if self._roomy else full)
        return self._roomy

    def _freeze(self, ending: bool) -> None:
        settings = self._settings
        if ending or self._spool.age_s >= settings.batch_s or self._spool.rows >= settings.batch_rows:
            try:
                self._spool.freeze()
            except SpoolUnusable as error:
                self._alarm(AlarmKind.SPOOL_FAILED, str(error))

    def _alarm(self, kind: AlarmKind, text: str | None) -> None:
        """Begin an alarm, go on with it, or end it where there is nothing to say."""
        if text is None:
            self._alarms.pop(kind, None)
            return
        new = kind not in self._alarms
        self._alarms[kind] = Alarm(kind, text)
        if new and self._on_alarm is not None:
            self._on_alarm(self._alarms[kind])

    # --- what the queue holds

    def _known(self, robot: str) -> Gathering:
        return self._robots.setdefault(robot, Gathering(robot))

    def _session(self, robot: str) -> str:
        return self._known(robot).session

    def _take(self, robot: str, new: Notification) -> Iterable[Record]:
        known = self._known(robot)
        begun = [] if known.session else self._begin(records.begin(robot, Facts(units=known.units)))
        return [*begun, *known.take(new)]

    def _begin(self, session: Session) -> list[Record]:
        ended = self._end(session.robot)
        self._known(session.robot).session = session.name
        self._sessions[session.robot] = session
        return [*ended, session.record()]

    def _end(self, robot: str) -> list[Record]:
        self._known(robot).session = ""
        session = self._sessions.pop(robot, None)
        return [] if session is None else [session.ended().record()]

    def _describe(self, robot: str, description: Description, utc_ns: int) -> list[Record]:
        known = self._known(robot)
        known.describe({channel.name: channel.unit for channel in description.channels})
        problems = []
        if description.robot != robot:
            problems.append(f"{robot} in the server's file calls itself {description.robot}")
        other = self._names.setdefault(description.robot, robot)
        if other != robot:
            problems.append(f"{robot} and {other} both call themselves {description.robot}")
        return [known.event(EventKind.NAME, problem, utc_ns) for problem in problems]

    def _journal(self, robot: str, entries: Sequence[Entry], utc_ns: int) -> list[Record]:
        new = news(entries, self._heads.get(robot))
        if entries:
            self._heads[robot] = JournalHead(entries[-1]["n"], entries[-1]["hash"])
        found = [records.journal(robot, entry) for entry in new.entries]
        if new.missing:
            text = f"{new.missing} entries of the robot's journal were never seen"
            found.append(self._known(robot).event(EventKind.JOURNAL_GAP, text, utc_ns, missing=new.missing))
        return found
