"""Some robots or sessions, copied as rows into a store of their own."""

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass

import pyarrow as pa

from ml.store import reading
from ml.store.errors import StoreError
from ml.store.sessions import Session
from ml.store.store import Store
from ml.store.tables import TABLES, TELEMETRY, Table
from server_gui.core.cloud.merge import Merge

Advance = Callable[[int], object]


@dataclass(frozen=True, slots=True)
class CopyScope:
    """The rows of a robot, or of one of its sessions."""

    robot: str
    session: str | None = None

    def values(self, table: Table) -> dict[str, str]:
        """Return the values that its rows in this table share; a robot's journal belongs to no session."""
        named = {"robot": self.robot, "session": self.session}
        return {name: value for name, value in named.items() if value and name in table.schema.names}


def copy(
    source: Store, target: Store, sessions: Sequence[Session], robots: Collection[str], advance: Advance
) -> int:
    """Copy these sessions, and everything else of these robots; how many rows of telemetry that were.

    What the target has stays, and what it lacks is added, so a copy that was interrupted, or is older, is
    called again. `advance` hears of rows.

    Raises:
        StoreError: a store cannot be used, or the target has something else by the same name: then nothing
            is copied. Or rows are missing afterwards.

    """
    parts = {CopyScope(each.robot, None if each.robot in robots else each.session) for each in sessions}
    parts |= {CopyScope(robot) for robot in robots}
    others = [table for table in TABLES.values() if table is not TELEMETRY]
    merges = [
        (_merge(source, target, table, part), table, part) for table in others for part in _sorted(parts)
    ]
    for merge in (*(_of(source, target, session) for session in sessions), *(each[0] for each in merges)):
        merge.check()
    copied = sum(_telemetry(source, target, session, advance) for session in sessions)
    for merge, table, part in merges:
        _add(target, merge, table, part)
    return copied


def _sorted(parts: Collection[CopyScope]) -> list[CopyScope]:
    return sorted(parts, key=str)


def _merge(source: Store, target: Store, table: Table, part: CopyScope) -> Merge:
    return Merge(source, target, table, part.values(table))


def _of(source: Store, target: Store, session: Session) -> Merge:
    return _merge(source, target, TELEMETRY, CopyScope(session.robot, session.session))


def _telemetry(source: Store, target: Store, session: Session, advance: Advance) -> int:
    part = CopyScope(session.robot, session.session)
    added = _add(target, _of(source, target, session), TELEMETRY, part, advance)
    there = _rows(target, session)
    if there < session.rows:  # there are more where it went on meanwhile
        raise StoreError(
            f"{target.url} has {there} of the {session.rows} rows of {session.session}; copy it again"
        )
    advance(max(session.rows - added, 0))
    return added


def _rows(store: Store, session: Session) -> int:
    files = reading.files(store, TELEMETRY, session.robot)
    mine = (session.robot, session.session)
    return sum(file.rows for file in files if (file.robot, file.session) == mine)


def _add(
    target: Store, merge: Merge, table: Table, part: CopyScope, advance: Advance = lambda _: None
) -> int:
    """Add what is new; how many rows that are."""
    added = 0

    def told(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        nonlocal added
        for batch in batches:
            yield batch
            added += batch.num_rows
            advance(batch.num_rows)

    with merge.new() as rows:
        first = next((batch for batch in rows if batch.num_rows), None)
        if first is not None:
            batches = told(itertools.chain([first], rows))
            reader = pa.RecordBatchReader.from_batches(rows.schema, batches)
            target.add(table, table.location(part.robot, target.about.shards), reader)
    return added
