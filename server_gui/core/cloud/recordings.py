"""Every recording, wherever it is: in the store, in this computer's spool, or half in each; every row once.

A batch of the spool is in a table of the store if that says so itself, and is read in the spool if not.
Where the table says so and the batch waits all the same, a later one was faster, or a collector was killed
before it knew: of these the rows are read that the table lacks. The spool is listed before a table is looked
at, and each table is looked at once: what is uploaded meanwhile is neither missed nor found twice.
"""

import functools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final

import msgspec
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset

from ml.store import NoSuchTable, StoreError, StoreRefused, StoreUnreachable, Table, sessions
from ml.store.labels import holding
from ml.store.precedence import recorded_order
from ml.store.sessions import Channel, Session, SessionPiece, TelemetrySource
from ml.store.snapshot import Snapshot
from ml.store.tables import EVENTS, LABELS, SESSIONS, TELEMETRY, ColumnFacts, columns
from ml.store.translation import translated
from server_gui.core.cloud import spool_reader
from server_gui.core.processing.wiring import STATE
from server_gui.core.recording import missing_rows
from server_gui.core.recording.columns import OWN, Columns
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.receipts import RECEIPTS, Receipts, went_to

_US: Final = timedelta(microseconds=1)
Row = dict[str, Any]
Lacking = Callable[
    [pa.RecordBatch], Sequence[pa.RecordBatch]
]  # of a run's rows, those that are to be read here


class Recordings:
    """Recordings at the time of its making; for one thread.

    Where the store cannot be reached, `problem` says why, and the recordings are those of which this
    computer's spool has something, also what it keeps of uploaded batches. Where the spool or a batch of it
    cannot be read, `unread` says why, and sessions of which nothing else is known are not listed; what may
    have rows there is not opened, and raises that.

    Raises:
        StoreError: there is no store, or it cannot be reached, and nothing in the spool either.
        SpoolUnusable: likewise, and the spool cannot be read.

    """

    def __init__(self, url: str, spool: Path) -> None:
        """`spool` is the one that goes to this store; a folder that is not there has nothing."""
        self.problem: StoreError | None = None
        self.unread: SpoolUnusable | None = None
        self._url = url
        self._spool = spool
        self._batches = self._listed(spool_reader.waiting)
        self._writers: dict[int, str] = {}  # of the batches
        self._store: Snapshot | None = None
        self._reach()

    def _reach(self) -> None:
        try:
            self._store = Snapshot.existing(self._url)
        except NoSuchTable as error:
            if not self.sessions():
                raise (self.unread or error) from None
        except (StoreRefused, StoreUnreachable) as error:
            self._batches = self._listed(spool_reader.kept)
            if not self.sessions():
                raise
            self.problem = error

    def sessions(self) -> list[Session]:
        """Return every session, oldest first; rows that wait for upload are not counted."""
        told: list[Row] = []
        names: dict[tuple[str, str], Session] = {}
        for batch in self._batches:
            try:
                here = spool_reader.untold(self._spool, [batch], ())
                here = here if self.problem is None else spool_reader.with_store_away(here)
                told += self._waiting(SESSIONS, [batch])
            except SpoolUnusable as error:
                self.unread = self.unread or error
            else:
                names |= {(each.robot, each.session): each for each in here}
        found = (
            sessions.unstored(told) if self._store is None else sessions.sessions(self._store, waiting=told)
        )
        known = {(each.robot, each.session) for each in found}
        return sessions.in_order([*found, *(each for name, each in names.items() if name not in known)])

    def gone(self) -> str | None:
        """In words, where a table of telemetry is not there that batches of the spool went to."""
        if self._store is None:
            return None
        try:
            receipts = list(Receipts(self._spool / RECEIPTS).whole())
        except OSError:  # nobody can say, and that the spool cannot be read is told besides
            return None
        sent = went_to(receipts, self._store.url)
        wanted = {part.location for each in sent for part in each.parts if part.stream and part.rows}
        lost = [location for location in sorted(wanted) if not self._is_there(location)]
        return (
            f"{', '.join(lost)} has gone from {self._url}, though batches of the spool {self._spool} went "
            "there: rows of its sessions are missing (gwrms cloud verify tells which)"
            if lost
            else None
        )

    def find(self, name: str, robot: str | None = None) -> Session:
        """Return the session whose name is this, or alone begins so.

        Raises:
            NoSuchSession: none, or several do.
            StoreError: the store, which may have it, cannot be reached.

        """
        known = [each for each in self.sessions() if robot in (None, each.robot)]
        why = self.problem or self.unread
        if why is not None and not any(each.session.startswith(name) for each in known):
            raise why
        return sessions.among(known, name, self._url)

    def rows_of(self, session: Session, table: Table = EVENTS) -> list[Row]:
        """Return the session's rows of this table, in the order in which they were recorded."""
        stored = [] if self._store is None else sessions.rows_of(self._store, session, table)
        mine = (session.robot, session.session)
        waiting = self._waiting(table, self._batches)
        told = [row for row in waiting if (row["robot"], row["session"]) == mine]
        return recorded_order([*stored, *told])

    def labels(self, session: Session) -> list[Row]:
        """Return the valid labels of a session."""
        return holding(self.rows_of(session, LABELS))

    def counted(self, session: Session) -> Session:
        """Return the session with the extent of all of its rows."""
        return self._looked_into(session).added_to(session)

    def open(self, session: Session) -> "Recorded":
        """Look into its telemetry."""
        waiting = self._looked_into(session)
        known = [] if self._store is None else sessions.channels(self._store, session)
        sources = [] if self._store is None else [sessions.stored(self._store, session)]
        return Recorded(
            waiting.added_to(session),
            waiting.channels(known),
            waiting.rows,
            [*sources, waiting.source()] if waiting.rows else sources,
            self._url,
        )

    # --- inside

    def _listed(self, look: Callable[[Path], list[int]]) -> list[int]:
        try:
            return look(self._spool)
        except SpoolUnusable as error:
            self.unread = error
            return []

    def _looked_into(self, session: Session) -> "_Waiting":
        shards = 1 if self._store is None else self._store.about.shards
        location = TELEMETRY.location(session.robot, shards)
        there = {} if self._store is None else self._store.columns(location)
        lacking = {
            each: functools.partial(self._lacking, location, each)
            for each in self._missing(location, self._batches)
        }
        return _Waiting(self._spool, lacking, session, there, shards)

    def _is_there(self, location: str) -> bool:
        try:
            return self._store is not None and self._store.table(location) is not None
        except NoSuchTable:
            return False

    def _waiting(self, table: Table, batches: list[int]) -> list[Row]:
        """Return the table's rows in these batches that it does not have."""
        found: list[Row] = []
        for batch in self._missing(table.name, batches):
            rows = spool_reader.table_of(self._spool, table, [batch])
            if rows.num_rows and self._store is not None and self._claims(table.name, batch):
                lacking = missing_rows.of_rows(self._store, table, rows, _unheard).to_batches()
                rows = pa.Table.from_batches(
                    missing_rows.newer(lacking, self._store, table.name), rows.schema
                )
            found += rows.to_pylist()
        return found

    def _missing(self, location: str, batches: list[int]) -> list[int]:
        """Return the batches of the spool of which this table may lack something."""
        return [
            each
            for each in batches
            if not self._claims(location, each) or spool_reader.waits(self._spool, each)
        ]

    def _lacking(self, location: str, batch: int, run: pa.RecordBatch) -> Sequence[pa.RecordBatch]:
        """Return the rows of a run in this batch that the table does not have."""
        if self._store is None or not self._claims(location, batch):
            return [run]
        return missing_rows.newer([missing_rows.by_key(self._store, location, run)], self._store, location)

    def _claims(self, location: str, batch: int) -> bool:
        """Return whether the table says it has this batch of the spool, or a later one of its writer."""
        return self._store is not None and self._store.has(location, self._writer(batch), batch)

    def _writer(self, batch: int) -> str:
        if batch not in self._writers:
            self._writers[batch] = spool_reader.writer(self._spool, batch)
        return self._writers[batch]


@dataclass(frozen=True, slots=True)
class Recorded:
    """A session's telemetry; `waiting` of its rows are in this computer's spool alone."""

    session: Session
    channels: Sequence[Channel]
    waiting: int
    _sources: Sequence[TelemetrySource]
    _url: str

    @property
    def enabled(self) -> dict[str, frozenset[float]]:
        """The numbers that mean *operation enabled*, by the channel of a drive's state; of those recorded."""
        found = {}
        for key, said in self.session.setup.items():
            section, _, channel = key.partition("/")
            if section == "enabled" and channel.endswith(f".{STATE}"):
                found[channel] = frozenset(float(number) for number in str(said).split(",") if number)
        return found

    def telemetry(
        self, names: Sequence[str], begin: datetime | None = None, end: datetime | None = None
    ) -> Iterator[pa.Table]:
        """Yield the rows from `begin` up to before `end`, as `ml.store.sessions.telemetry`."""
        with translated(f"the telemetry of {self.session.session} in {self._url} cannot be read"):
            yield from sessions.merged(self._sources, names, begin, end)


class _Waiting:
    """A session's telemetry that the store lacks, as columns of the store; read when it is asked for."""

    def __init__(
        self,
        spool: Path,
        batches: Mapping[int, Lacking],
        session: Session,
        there: Mapping[str, ColumnFacts],
        shards: int,
    ) -> None:
        self._spool = spool
        self._lacking = batches
        self._session = session
        self._there = there
        self._shards = shards
        self._before: dict[
            int, Mapping[str, ColumnFacts]
        ] = {}  # the table's columns when a batch comes to it
        self._samples: Counter[str] = Counter()
        self._pieces = {batch: piece for batch in batches if (piece := self._looked_into(batch))}
        self.rows = sum(piece.rows for piece in self._pieces.values())

    def source(self) -> TelemetrySource:
        """Return all of it, for `merged`."""
        return TelemetrySource([*self._pieces.values()], self._between)

    def _between(self, begin_ns: int, end_ns: int) -> pyarrow.dataset.Dataset:
        """Return the batches that have something with such stamps."""
        wanted = [
            batch
            for batch, (_, _, first_ns, last_ns, _) in self._pieces.items()
            if first_ns is not None and last_ns is not None and first_ns < end_ns and last_ns >= begin_ns
        ]
        found = [self._table(batch) for batch in wanted] or [TELEMETRY.schema.empty_table()]
        return pyarrow.dataset.dataset(pa.concat_tables(found, promote_options="default"))

    def channels(self, stored: Sequence[Channel]) -> list[Channel]:
        """Return the channels, with those that the store has of the session."""
        samples = self._samples + Counter({each.name: each.samples for each in stored})
        told = {each.name: each.unit for each in stored}
        return [Channel(name, told.get(name, self._unit(name)), samples[name]) for name in sorted(samples)]

    def _unit(self, column: str) -> str | None:
        return self._there.get(column, ColumnFacts()).unit

    def added_to(self, session: Session) -> Session:
        """Return the session with the extent of all of its rows."""
        pieces = self._pieces.values()
        first = min(
            (time for time in (session.first, *(each.first for each in pieces)) if time), default=None
        )
        last = max((time for time in (session.last, *(each.last for each in pieces)) if time), default=None)
        return msgspec.structs.replace(session, first=first, last=last, rows=session.rows + self.rows)

    def _looked_into(self, batch: int) -> SessionPiece | None:
        self._before[batch] = self._there
        rows = self._table(batch)
        self._there = {**self._there, **columns(rows.schema)}
        if not rows.num_rows:
            return None
        for name in rows.column_names:
            if name not in OWN and (samples := rows.num_rows - rows[name].null_count):
                self._samples[name] += samples
        utc, stamps = (pc.min_max(rows[name]).as_py() for name in sessions.KEYS)
        return SessionPiece(utc["min"], utc["max"] + _US, stamps["min"], stamps["max"], rows.num_rows)

    def _table(self, batch: int) -> pa.Table:
        """With the columns to which the upload brings the batch, which has other robots' channels too."""
        runs = list(spool_reader.runs(self._spool, self._session, batch))
        here = TELEMETRY.location(self._session.robot, self._shards)
        layouts = [
            layout
            for robot, layout in spool_reader.layouts(self._spool, batch)
            if TELEMETRY.location(robot, self._shards) == here
        ]
        found = Columns(layouts, self._before[batch])
        lacking = self._lacking[batch]
        pieces = [piece for run in runs for piece in lacking(found.batch(run))]
        return pa.Table.from_batches(pieces, schema=found.schema)


def _unheard(_: str) -> None:
    """Ignore a difference: `gwrms cloud verify` reports it."""
