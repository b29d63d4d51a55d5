"""A recorded session to be played: its rows by time, from the store and from what waits in the spool."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from ml.store import NoSuchTable, Store, sessions
from ml.store.labels import utc_ns
from ml.store.sessions import Session
from ml.store.tables import EVENTS
from server_gui.core.cloud import spooled
from server_gui.core.recording.rows import Floats, Ints, Run
from server_gui.core.settings.server_file import ServerSettings

Bools = npt.NDArray[np.bool_]

MOST_WAITING: Final = 400_000  # rows of the spool that are held in memory, the newest: above an hour of them
US_NS: Final = 1_000  # the store keeps UTC to the microsecond


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows in order; UTC and the robot's clock in ns never fall. A column a channel, NaN where missing."""

    utc_ns: Ints
    stamps_ns: Ints
    columns: Mapping[str, Floats]

    def __len__(self) -> int:
        return len(self.utc_ns)

    def between(self, begin_ns: int, end_ns: int) -> "Rows":
        """Those from `begin_ns` up to before `end_ns`."""
        first, last = np.searchsorted(self.utc_ns, (begin_ns, end_ns))
        return self.part(slice(int(first), int(last)))

    def part(self, part: slice) -> "Rows":
        """These rows."""
        columns = {name: column[part] for name, column in self.columns.items()}
        return Rows(self.utc_ns[part], self.stamps_ns[part], columns)

    @classmethod
    def joined(cls, parts: Sequence["Rows"]) -> "Rows":
        """All of these, in the order of the robot's clock; a row that is in two of them is there once."""
        names = list(dict.fromkeys(name for part in parts for name in part.columns))
        stamps_ns, utc = (
            np.concatenate([np.empty(0, np.int64), *found])
            for found in ([part.stamps_ns for part in parts], [part.utc_ns for part in parts])
        )
        order = np.lexsort((utc, stamps_ns))
        columns = {name: np.concatenate([_column(part, name) for part in parts]) for name in names}
        if len(order):
            order = order[~_again(stamps_ns[order], columns, order)]
        columns = {name: column[order] for name, column in columns.items()}
        return cls(np.maximum.accumulate(utc[order]), stamps_ns[order], columns)


@dataclass(frozen=True, slots=True)
class Tape:
    """A session, what happened in it, and how its rows are read; `units` are those of its channels."""

    session: Session
    units: Mapping[str, str]
    events: Sequence[Mapping[str, Any]]
    first_ns: int
    last_ns: int
    waiting: Rows
    _stored: tuple[str, ...] = field(repr=False)
    _url: str

    @classmethod
    def open(cls, settings: ServerSettings, session: Session) -> Self:
        """Look into it; blocks.

        Raises:
            StoreError: the store cannot be reached, or there is no telemetry of this session at all.
            SpoolUnusable: what waits cannot be read.

        """
        spool = settings.recorder.spool
        batches = spooled.waiting(spool)
        runs = (run for batch in batches for run in spooled.runs(spool, session, batch))
        waiting = Rows.joined(_newest(map(_rows_of, runs)))
        events: list[Mapping[str, Any]] = list(_of(session, spooled.rows(spool, EVENTS, batches)))
        stored: dict[str, str | None] = {}
        if session.uploaded and session.rows:
            store = Store.existing(settings.store.url)
            stored = {each.name: each.unit for each in sessions.channels(store, session)}
            events = _once([*sessions.happenings(store, session), *events])
        first_ns, last_ns = _extent(session, waiting)
        units = _units(session, {**dict.fromkeys(waiting.columns), **stored})
        return cls(session, units, events, first_ns, last_ns, waiting, tuple(stored), settings.store.url)

    def read(self, begin_ns: int, end_ns: int) -> Rows:
        """The rows from `begin_ns` up to before `end_ns`; blocks. Raises `StoreError`."""
        parts = [self.waiting.between(begin_ns, end_ns)]
        if self._stored:
            store = Store.existing(self._url)
            found = sessions.telemetry(store, self.session, self._stored, as_time(begin_ns), as_time(end_ns))
            parts += [_rows(table) for table in found]
        return Rows.joined(parts)


def _units(session: Session, held: Mapping[str, str | None]) -> dict[str, str]:
    """The unit of each channel that is there, in the robot's order; what the store says goes before."""
    told = {name: str(unit) for name, unit in session.units.items() if name in held}
    return told | {name: unit or told.get(name, "") for name, unit in held.items()}


def _of(session: Session, rows: Iterable[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    return (row for row in rows if (row["robot"], row["session"]) == (session.robot, session.session))


def _extent(session: Session, waiting: Rows) -> tuple[int, int]:
    """From its first row to its last, in ns since 1970."""
    begins = [utc_ns(time) for time in (session.first,) if time is not None]
    ends = [utc_ns(time) for time in (session.last,) if time is not None]
    if len(waiting):
        begins.append(int(waiting.utc_ns[0]))
        ends.append(int(waiting.utc_ns[-1]) + 1)
    if not begins:
        raise NoSuchTable(
            f"the session {session.session} has no telemetry, neither in the store nor in the spool"
        )
    return min(begins), max(ends)


def _newest(parts: Iterable[Rows]) -> list[Rows]:
    """The newest `MOST_WAITING` rows of these."""
    found = sorted((part for part in parts if len(part)), key=lambda part: int(part.stamps_ns[0]))
    rows = 0
    kept: list[Rows] = []
    for part in reversed(found):
        rows += len(part)
        if rows > MOST_WAITING:
            break
        kept.append(part)
    return kept


def _rows_of(run: Run) -> Rows:
    columns = dict(zip(run.layout.channels, run.values, strict=True))
    return Rows(run.stamps_ns + run.utc_offset_ns, run.stamps_ns, columns)


def _rows(table: pa.Table) -> Rows:
    utc, stamps = (table[name].combine_chunks() for name in sessions.KEYS)
    columns = {
        name: table[name].to_numpy(zero_copy_only=False).astype(np.float64)
        for name in table.column_names
        if name not in sessions.KEYS
    }
    in_ns = utc.cast(pa.int64()).to_numpy(zero_copy_only=False) * US_NS
    return Rows(in_ns, stamps.to_numpy(zero_copy_only=False).astype(np.int64), columns)


def _again(stamps_ns: Ints, columns: Mapping[str, Floats], order: Ints) -> Bools:
    """Which rows are there before already. Samples of two sources may have one stamp, and are two rows."""
    same = np.append(False, np.diff(stamps_ns) == 0)
    again = np.zeros(len(stamps_ns), np.bool_)
    rows = np.flatnonzero(same | np.append(same[1:], False))
    values = np.array([column[order[rows]] for column in columns.values()]).T
    seen: set[tuple[int, bytes]] = set()
    for row, held in zip(rows.tolist(), values, strict=True):
        key = (int(stamps_ns[row]), held.tobytes())
        again[row] = key in seen
        seen.add(key)
    return again


def _column(part: Rows, name: str) -> Floats:
    column = part.columns.get(name)
    return np.full(len(part), np.nan) if column is None else column


def _once(events: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """In time's order; what was uploaded meanwhile is in both."""
    found = {(row["utc"], row["kind"], row["text"]): row for row in events}
    return [found[key] for key in sorted(found)]


def as_time(instant_ns: int) -> datetime:
    """An instant as the store writes it."""
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=instant_ns // US_NS)
