"""A spool, looked into without disturbing who records into it."""

import contextlib
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import msgspec

from ml.store.fragments import Extent
from ml.store.sessions import Session, made, newest
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.rows import Record

_WAITING: Final = "????????.db"
_UPLOADED: Final = "????????.uploaded.db"
_TIMES: Final = ("utc", "began", "ended")
_decoder = msgspec.msgpack.Decoder(Record)


@dataclass(frozen=True, slots=True)
class Batch:
    """A batch that is marked as uploaded: whose telemetry is in it, and rows of which other tables."""

    spool: str
    number: int
    robots: frozenset[str]
    tables: frozenset[str]


def sessions(spool: Path) -> list[Session]:
    """Those that are told of in what waits for upload; their telemetry is not counted."""
    records = (record for segment in sorted(spool.glob(_WAITING)) for record in _records(segment))
    rows = (record.fields for record in records if record.table == "sessions")
    return [
        made(row | {name: _time(row[name]) for name in _TIMES}, Extent(()), uploaded=False)
        for row in newest(rows)
    ]


def uploaded(spool: Path) -> Iterator[Batch]:
    """Every batch that is kept as a second copy, oldest first."""
    for segment in sorted(spool.glob(_UPLOADED)):
        robots = frozenset(robot for (robot,) in _read(segment, "SELECT DISTINCT robot FROM run"))
        tables = frozenset(record.table for record in _records(segment))
        yield Batch((spool / "id").read_text().strip(), int(segment.name[:8]), robots, tables)


def _records(segment: Path) -> list[Record]:
    found = _read(segment, "SELECT content FROM record ORDER BY number")
    return [_decoder.decode(content) for (content,) in found]


def _read(segment: Path, sql: str) -> list[tuple[Any, ...]]:
    """Nothing where the file has gone: who records may just have uploaded or removed it.

    Raises:
        SpoolUnusable: it is there and cannot be read.

    """
    try:
        with contextlib.closing(sqlite3.connect(f"{segment.as_uri()}?mode=ro", uri=True)) as database:
            return database.execute(sql).fetchall()
    except sqlite3.Error as error:
        if segment.exists():
            raise SpoolUnusable(f"the spool's file {segment} cannot be read: {error}") from error
        return []


def _time(utc_ns: int | None) -> datetime | None:
    return None if utc_ns is None else datetime.fromtimestamp(utc_ns / 1e9, UTC)
