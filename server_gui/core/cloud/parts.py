"""Some robots or sessions, copied as rows into a store of their own."""

import functools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import pyarrow as pa
import pyarrow.dataset

from ml.store import reading
from ml.store.errors import StoreError, translated
from ml.store.sessions import Session
from ml.store.store import Store
from ml.store.tables import TABLES, TELEMETRY, Table

ROWS_AT_ONCE: Final = 20_000
Advance = Callable[[int], object]


@dataclass(frozen=True, slots=True)
class Part:
    """The rows of a robot, or of one of its sessions."""

    robot: str
    session: str | None = None

    def values(self, table: Table) -> dict[str, str]:
        """What its rows in this table have in common; a robot's journal belongs to no session."""
        named = {"robot": self.robot, "session": self.session}
        return {name: value for name, value in named.items() if value and name in table.schema.names}


def copy(
    source: Store, target: Store, sessions: Sequence[Session], robots: Collection[str], advance: Advance
) -> int:
    """Copy these sessions, and everything else of these robots; how many rows of telemetry that were.

    What the target has of them is replaced. A session of which it has as many rows is left as it is, so a
    copy that was interrupted is called again. `advance` hears of rows.

    Raises:
        StoreError: a store cannot be used, or rows are missing afterwards.

    """
    copied = sum(_telemetry(source, target, session, advance) for session in sessions)
    parts = {Part(each.robot, None if each.robot in robots else each.session) for each in sessions}
    parts |= {Part(robot) for robot in robots}
    for table in TABLES.values():
        for part in sorted(parts, key=str) if table is not TELEMETRY else ():
            _replace(source, target, table, part)
    return copied


def _telemetry(source: Store, target: Store, session: Session, advance: Advance) -> int:
    there = functools.partial(_rows, target, session)
    if there() == session.rows:
        advance(session.rows)
        return 0
    _replace(source, target, TELEMETRY, Part(session.robot, session.session), advance)
    if there() < session.rows:  # there are more where it went on meanwhile
        raise StoreError(
            f"{target.url} has {there()} of the {session.rows} rows of {session.session}; copy it again"
        )
    return there()


def _rows(store: Store, session: Session) -> int:
    files = reading.files(store, TELEMETRY, session.robot)
    mine = (session.robot, session.session)
    return sum(file.rows for file in files if (file.robot, file.session) == mine)


def _replace(
    source: Store, target: Store, table: Table, part: Part, advance: Advance = lambda _: None
) -> None:
    values = part.values(table)
    wanted = functools.reduce(
        lambda one, other: one & other,
        (pyarrow.dataset.field(name) == value for name, value in values.items()),
    )
    where = " AND ".join("{} = '{}'".format(name, value.replace("'", "''")) for name, value in values.items())
    with translated(f"{source.url}/{table.name} cannot be read"):
        rows = reading.dataset(source, table, part.robot)
        if not rows.head(1, filter=wanted).num_rows:
            return
        reader = rows.scanner(filter=wanted, batch_size=ROWS_AT_ONCE).to_reader()
        told = pa.RecordBatchReader.from_batches(reader.schema, _told(reader, advance))
        target.replace(table, table.location(part.robot, target.about.shards), told, where)


def _told(reader: pa.RecordBatchReader, advance: Advance) -> Iterator[pa.RecordBatch]:
    for batch in reader:
        yield batch
        advance(batch.num_rows)
