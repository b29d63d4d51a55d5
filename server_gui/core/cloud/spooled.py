"""A spool, looked into without disturbing who records into it."""

import contextlib
import sqlite3
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import msgspec

import ml.store.sessions
from ml.store import NoSuchTable, Store, Table
from ml.store.fragments import Extent
from ml.store.sessions import Session, in_order, made, newest
from ml.store.tables import SESSIONS
from ml.store.tables import UTC as UTC_TIME
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.rows import Layout, Record, Run, unpack

_WAITING: Final = "????????.db"
_UPLOADED: Final = "????????.uploaded.db"
_decoder = msgspec.msgpack.Decoder(Record)
_layout_decoder = msgspec.msgpack.Decoder(Layout)


@dataclass(frozen=True, slots=True)
class Batch:
    """A batch that is marked as uploaded: whose telemetry is in it, and rows of which other tables."""

    spool: str
    number: int
    robots: frozenset[str]
    tables: frozenset[str]


def sessions(spool: Path) -> list[Session]:
    """Those that are told of in what waits for upload; their telemetry is not counted."""
    return [made(row, Extent(()), uploaded=False) for row in newest(rows(spool, SESSIONS))]


def all_sessions(spool: Path, store: Callable[[], Store]) -> list[Session]:
    """The store's sessions, and those that this computer's spool alone has, oldest first.

    Raises:
        StoreError: the store cannot be read; or there is none, and nothing in the spool either.

    """
    waiting = {(each.robot, each.session): each for each in sessions(spool)}
    try:
        stored = ml.store.sessions.sessions(store())
    except NoSuchTable:
        if not waiting:
            raise
        stored = []
    for each in stored:
        waiting.pop((each.robot, each.session), None)
    return in_order([*stored, *waiting.values()])


def rows(spool: Path, table: Table) -> list[dict[str, Any]]:
    """A table's rows in what waits for upload, their times as the store has them."""
    times = [column.name for column in table.schema if column.type == UTC_TIME]
    return [
        record.fields | {name: _time(record.fields.get(name)) for name in times}
        for segment in sorted(spool.glob(_WAITING))
        for record in _records(segment)
        if record.table == table.name
    ]


def runs(spool: Path, session: Session) -> Iterator[Run]:
    """A session's telemetry in what waits for upload, with what is being recorded; in no order."""
    sql = (
        "SELECT connection, stream, description, data FROM run JOIN layout ON layout = layout.id "
        "WHERE run.robot = ? AND session = ?"
    )
    for segment in sorted(spool.glob(_WAITING)):
        for connection, stream, description, data in _read(segment, sql, session.robot, session.session):
            layout = _layout_decoder.decode(description)
            yield unpack(session.robot, session.session, connection, stream, layout, data)


def uploaded(spool: Path) -> Iterator[Batch]:
    """Every batch that is kept as a second copy, oldest first."""
    for segment in sorted(spool.glob(_UPLOADED)):
        robots = frozenset(robot for (robot,) in _read(segment, "SELECT DISTINCT robot FROM run"))
        tables = frozenset(record.table for record in _records(segment))
        yield Batch((spool / "id").read_text().strip(), int(segment.name[:8]), robots, tables)


def _records(segment: Path) -> list[Record]:
    found = _read(segment, "SELECT content FROM record ORDER BY number")
    return [_decoder.decode(content) for (content,) in found]


def _read(segment: Path, sql: str, *values: str) -> list[tuple[Any, ...]]:
    """Nothing where the file has gone, or holds nothing yet: who records may just be making or removing it.

    Raises:
        SpoolUnusable: it is there and cannot be read.

    """
    try:
        with contextlib.closing(sqlite3.connect(f"{segment.as_uri()}?mode=ro", uri=True)) as database:
            return database.execute(sql, values).fetchall()
    except sqlite3.Error as error:
        if segment.exists() and "no such table" not in str(error):
            raise SpoolUnusable(f"the spool's file {segment} cannot be read: {error}") from error
        return []


def _time(utc_ns: int | None) -> datetime | None:
    """To the microsecond, as the store keeps it."""
    return (
        None if utc_ns is None else datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=utc_ns // 1000)
    )
