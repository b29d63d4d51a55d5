"""A spool, looked into without disturbing who records into it."""

import contextlib
import itertools
import os
import sqlite3
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec
import pyarrow as pa

from ml.store import Table
from ml.store import sessions as sessions_
from ml.store.fragments import Extent
from ml.store.sessions import Session, unstored
from ml.store.tables import SESSIONS
from server_gui.core.recording.checksums import DATA, is_sound, unaltered
from server_gui.core.recording.errors import Damaged, SpoolUnusable
from server_gui.core.recording.rows import Layout, Record, Run, unpack
from server_gui.core.recording.segment import translated
from server_gui.core.recording.spool_files import identity

_NUMBER: Final = "[0-9]" * 8
_decoder = msgspec.msgpack.Decoder(Record)
_layout_decoder = msgspec.msgpack.Decoder(Layout)


@dataclass(frozen=True, slots=True)
class Batch:
    """A batch: who brings it to the store, whose telemetry is in it, and rows of which other tables."""

    writer: str
    number: int
    robots: frozenset[str]
    tables: frozenset[str]


def waiting(spool: Path) -> list[int]:
    """Return the batches that wait for upload, and the one that is being recorded; oldest first.

    Raises:
        SpoolUnusable: the folder is there, and cannot be read.

    """
    if not os.access(spool, os.R_OK | os.X_OK) and os.access(spool, os.F_OK):
        raise SpoolUnusable(f"the spool {spool} cannot be read: it belongs to somebody else")
    return sorted(int(file.name[:8]) for file in spool.glob(f"{_NUMBER}.db"))


def waits(spool: Path, number: int) -> bool:
    """Return whether the batch waits for upload now."""
    return (spool / f"{number:08}.db").exists()


def is_empty(spool: Path, number: int) -> bool:
    """Return whether nothing has been recorded into it yet; not where that cannot be read."""
    try:
        return not any(_read(spool, number, f"SELECT 1 FROM {table} LIMIT 1") for table in ("run", "record"))
    except SpoolUnusable:
        return False


def kept(spool: Path) -> list[int]:
    """Return these, and uploaded ones that are still here; oldest first."""
    return sorted({*waiting(spool), *(int(file.name[:8]) for file in spool.glob(f"{_NUMBER}.uploaded.db"))})


def sessions(spool: Path) -> list[Session]:
    """Return those of which something waits for upload; their telemetry is not counted."""
    batches = waiting(spool)
    told = unstored(rows(spool, SESSIONS, batches))
    return [*told, *untold(spool, batches, ((each.robot, each.session) for each in told))]


def untold(spool: Path, batches: Iterable[int], known: Iterable[tuple[str, str]]) -> list[Session]:
    """Return those of which these batches have telemetry, and that are none of the known ones."""
    sql = "SELECT DISTINCT robot, session FROM run"
    found = {name for batch in batches for name in _read(spool, batch, sql)} - set(known)
    return [sessions_.untold(robot, name, Extent(()), uploaded=False) for robot, name in sorted(found)]


def with_store_away(found: Iterable[Session]) -> list[Session]:
    """Return these sessions without calling lost what may be in a store that was not read."""
    return [
        msgspec.structs.replace(each, notes=sessions_.UNREAD) if each.notes == sessions_.UNTOLD else each
        for each in found
    ]


def rows(spool: Path, table: Table, batches: Iterable[int] | None = None) -> list[dict[str, Any]]:
    """Return a table's rows in these batches, or in all that wait."""
    made: list[dict[str, Any]] = table_of(spool, table, batches).to_pylist()
    return made


def table_of(spool: Path, table: Table, batches: Iterable[int] | None = None) -> pa.Table:
    """Return the same as the store has them."""
    found = [
        record.fields | {"spool": name, "batch": batch, "number": number}
        for batch in (waiting(spool) if batches is None else batches)
        for name in [writer(spool, batch)]
        for number, record in _records(spool, batch)
        if record.table == table.name
    ]
    return table.rows(found)


def runs(spool: Path, session: Session, batch: int) -> Iterator[Run]:
    """Yield a session's telemetry in this batch, a run a stream and layout; without what is damaged."""
    sql = (
        "SELECT connection, stream, description, run.* FROM run JOIN layout ON layout = layout.id "
        "WHERE run.robot = ? AND session = ? ORDER BY connection, stream, layout, seq, row"
    )
    lines = _read(spool, batch, sql, session.robot, session.session)
    found = (line for line in lines if is_sound(session.robot, *line[2:]))
    for (connection, stream, description), alike in itertools.groupby(found, lambda line: line[:3]):
        layout, data = _layout_decoder.decode(description), b"".join(line[3 + DATA] for line in alike)
        yield unpack(session.robot, session.session, connection, stream, layout, data)


def layouts(spool: Path, batch: int) -> list[tuple[str, Layout]]:
    """Return each robot in this batch with each of its layouts, in the order in which they came."""
    found: list[tuple[str, Layout]] = []
    sql = "SELECT CAST(robot AS BLOB), description FROM layout ORDER BY id"
    for robot, description in _read(spool, batch, sql):
        with contextlib.suppress(msgspec.MsgspecError, TypeError, UnicodeError):  # its runs are damaged then
            found.append((robot.decode(), _layout_decoder.decode(description)))
    return found


def writer(spool: Path, number: int) -> str:
    """Return the name of a batch's writer at the store."""
    found = _read(spool, number, "SELECT value FROM meta WHERE key = 'writer'")
    return str(found[0][0]) if found else identity(spool)


def uploaded(spool: Path) -> list[int]:
    """Return the batches that are kept as a second copy, oldest first."""
    return sorted(set(kept(spool)) - set(waiting(spool)))


def damaged(spool: Path) -> list[tuple[int, Path]]:
    """Return the batches that were set aside or have lost commits, with their files."""
    files = (file for kind in ("damaged", "cut") for file in spool.glob(f"{_NUMBER}.{kind}.db"))
    return sorted((int(file.name[:8]), file) for file in files)


def batch(spool: Path, number: int) -> Batch:
    """Return the contents of a batch."""
    robots = frozenset(robot for (robot,) in _read(spool, number, "SELECT DISTINCT robot FROM run"))
    tables = frozenset(record.table for _, record in _records(spool, number))
    return Batch(writer(spool, number), number, robots, tables)


def named(spool: Path, number: int) -> set[tuple[str, str]]:
    """Return the sessions, with their robots, of which a batch has anything."""
    told = {(each.fields.get("robot"), each.fields.get("session")) for _, each in _records(spool, number)}
    return {*_read(spool, number, "SELECT DISTINCT robot, session FROM run"), *told}


def _records(spool: Path, batch: int) -> list[tuple[int, Record]]:
    """Return the records with their numbers, without damaged ones."""
    found = _read(spool, batch, "SELECT rowid, * FROM record ORDER BY rowid")  # older ones have no checksums
    return [
        (rowid - 1, _decoder.decode(content)) for rowid, _, content, *crc in found if unaltered(content, *crc)
    ]


def _read(spool: Path, batch: int, sql: str, *values: str) -> list[tuple[Any, ...]]:
    """Nothing where the batch holds nothing yet: who records may just be making it.

    Raises:
        SpoolUnusable: it cannot be read; or it went to the store, and was removed to make room.

    """
    advice = {".db": "gwrms cloud upload sets it aside", ".uploaded.db": "it is a second copy: remove it"}
    for suffix, what_to_do in advice.items():
        file = spool / f"{batch:08}{suffix}"
        try:
            with (
                translated(file),
                contextlib.closing(sqlite3.connect(f"{file.as_uri()}?mode=ro", uri=True)) as database,
            ):
                return database.execute(sql, values).fetchall() if _has(database, sql) else []
        except Damaged as error:
            raise Damaged(f"{error}; {what_to_do}") from error
        except SpoolUnusable:
            if file.exists():
                raise
    raise SpoolUnusable(f"batch {batch} of the spool {spool} has just gone to the store; ask again")


def _has(database: sqlite3.Connection, sql: str) -> bool:
    """Return whether it is there: there may be no tables yet, and once there was no `meta`."""
    tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    return bool(tables) and ("meta" in tables or " meta " not in sql)
