"""Sessions that only this computer's spool knows yet, looked at without disturbing who records into it."""

import contextlib
import sqlite3
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import msgspec

from ml.store.sessions import Extent, Session, made, newest
from server_gui.core.recording.rows import Record

_TIMES: Final = ("utc", "began", "ended")
_decoder = msgspec.msgpack.Decoder(Record)


def sessions(spool: Path) -> list[Session]:
    """What waits there for upload; each is as long as is known of it here."""
    return [made(fields, Extent(()), uploaded=False) for fields in newest(_rows(spool))]


def _rows(spool: Path) -> Iterator[dict[str, Any]]:
    for segment in sorted(spool.glob("????????.db")):  # those uploaded are named otherwise
        for record in _records(segment):
            if record.table == "sessions":
                times = {name: _time(record.fields[name]) for name in _TIMES}
                yield record.fields | times


def _records(segment: Path) -> list[Record]:
    """Its records, where it is still there: who records may just have uploaded it."""
    try:
        with contextlib.closing(sqlite3.connect(f"{segment.as_uri()}?mode=ro", uri=True)) as database:
            found = database.execute("SELECT content FROM record ORDER BY number").fetchall()
    except sqlite3.OperationalError:
        return []
    return [_decoder.decode(content) for (content,) in found]


def _time(utc_ns: int | None) -> datetime | None:
    return None if utc_ns is None else datetime.fromtimestamp(utc_ns / 1e9, UTC)
