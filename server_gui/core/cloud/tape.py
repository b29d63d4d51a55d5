"""A recorded session to be played: its rows by time, from the store and from what waits in the spool."""

import importlib.metadata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from ml.store import NoSuchTable, StoreError, sessions
from ml.store.labels import utc_ns
from ml.store.sessions import Channel, Session
from server_gui.core.cloud.recordings import Recorded, Recordings
from server_gui.core.recording.batching import EventKind
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.records import RECORDER
from server_gui.core.recording.rows import Floats, Ints
from server_gui.core.settings.server_file import ServerSettings

Bools = npt.NDArray[np.bool_]

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
        """Return those from `begin_ns` up to before `end_ns`."""
        first, last = np.searchsorted(self.utc_ns, (begin_ns, end_ns))
        return self.part(slice(int(first), int(last)))

    def part(self, part: slice) -> "Rows":
        """Return these rows."""
        columns = {name: column[part] for name, column in self.columns.items()}
        return Rows(self.utc_ns[part], self.stamps_ns[part], columns)

    @classmethod
    def joined(cls, parts: Sequence["Rows"]) -> "Rows":
        """Join these in the order of the robot's clock; a row that is in two of them is there once."""
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


@dataclass(slots=True)
class Tape:
    """A session, what happened in it, and how its rows are read; `units` are those of its channels.

    It is as it was when it was opened. For one thread at a time.
    """

    session: Session
    units: Mapping[str, str]
    events: Sequence[Mapping[str, Any]]
    first_ns: int
    last_ns: int
    _recorded: Recorded = field(repr=False)
    _settings: ServerSettings = field(repr=False)
    is_partial: bool = False  # the store, which may have more of it, was not reached

    @property
    def tells_of_buses(self) -> bool:
        """Whether trouble of its buses would be among its events: this version records that."""
        is_ours = self.session.versions.get(RECORDER) == importlib.metadata.version("gwrms")
        return is_ours or any(event.get("kind") == EventKind.BUS.value for event in self.events)

    @classmethod
    def open(cls, settings: ServerSettings, session: Session) -> Self:
        """Look into it; blocks.

        Raises:
            StoreError: the store cannot be reached, or there is no telemetry of this session at all.
            SpoolUnusable: what waits cannot be read.

        """
        recordings, recorded = _look(settings, session)
        session = recorded.session
        if session.first is None or session.last is None:
            raise NoSuchTable(
                f"the session {session.session} has no telemetry, neither in the store nor in the spool"
            )
        events, units = recordings.rows_of(session), _units(session, recorded.channels)
        ends = utc_ns(session.first), utc_ns(session.last)
        away = recordings.problem is not None
        return cls(session, units, events, *ends, recorded, settings, away)

    def read(self, begin_ns: int, end_ns: int, channels: Sequence[str] | None = None) -> Rows:
        """Return the rows from `begin_ns` up to before `end_ns`; blocks. Raises as `open`.

        Of `channels` alone, if given.
        """
        names = [*self.units] if channels is None else [*channels]
        try:
            return self._read(begin_ns, end_ns, names)
        except (SpoolUnusable, StoreError):  # what waited may have gone to the store, and old files
            _, self._recorded = _look(self._settings, self.session)
            return self._read(begin_ns, end_ns, names)

    def _read(self, begin_ns: int, end_ns: int, names: list[str]) -> Rows:
        found = self._recorded.telemetry(names, as_time(begin_ns), as_time(end_ns))
        return Rows.joined([_rows(table) for table in found])


def _look(settings: ServerSettings, session: Session) -> tuple[Recordings, Recorded]:
    recordings = Recordings(settings.store.url, settings.recorder.spool)
    if recordings.problem is not None and session.uploaded:
        raise recordings.problem
    return recordings, recordings.open(recordings.find(session.session, session.robot))


def _units(session: Session, channels: Iterable[Channel]) -> dict[str, str]:
    """Return the unit of each channel that is there, in the robot's order.

    What its column says goes before.
    """
    held = {each.name: each.unit for each in channels}
    told = {name: str(unit) for name, unit in session.units.items() if name in held}
    return told | {name: told.get(name, "") if unit is None else unit for name, unit in held.items()}


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
    """Return the rows that repeat earlier ones. Two sources' samples may share a stamp, and are two rows."""
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


def as_time(instant_ns: int) -> datetime:
    """Return an instant as the store writes it."""
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=instant_ns // US_NS)
