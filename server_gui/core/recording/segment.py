"""One file of the spool: a SQLite database that is written, then frozen, then only read."""

import collections
import contextlib
import functools
import itertools
import logging
import operator
import os
import sqlite3
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from ml.store.private import FILE
from ml.store.tables import JOURNAL
from server_gui.core.recording.checksums import DATA, of_head, of_layout, of_run, unaltered
from server_gui.core.recording.errors import Damaged, SpoolUnusable
from server_gui.core.recording.rows import JournalHead, Layout, Record, Run, pack, unpack

log = logging.getLogger(__name__)

SCHEMA: Final = """
BEGIN; -- one commit, so that a power cut leaves all of it or nothing
CREATE TABLE IF NOT EXISTS layout (id INTEGER PRIMARY KEY, robot TEXT NOT NULL, description BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS run (
    robot TEXT NOT NULL, connection TEXT NOT NULL, stream INTEGER NOT NULL,
    seq INTEGER NOT NULL, row INTEGER NOT NULL, -- of the first of its rows
    rows INTEGER NOT NULL, session TEXT NOT NULL, layout INTEGER NOT NULL, data BLOB NOT NULL,
    crc INTEGER, -- as `checksums.of_run`; null in segments from before there was one
    PRIMARY KEY (robot, connection, stream, seq, row)
);
CREATE TABLE IF NOT EXISTS record (
    number INTEGER PRIMARY KEY, content BLOB NOT NULL,
    crc INTEGER -- of the content; null in segments from before there was one
);
CREATE TABLE IF NOT EXISTS journal_head (
    robot TEXT PRIMARY KEY, n INTEGER NOT NULL, hash TEXT NOT NULL,
    crc INTEGER -- as `checksums.of_head`; null in segments from before there was one
);
CREATE TABLE IF NOT EXISTS meta (key TEXT PRIMARY KEY, value TEXT NOT NULL, crc INTEGER NOT NULL);
COMMIT;
"""
TABLES: Final = ("layout", "run", "record", "journal_head", "meta")
ROWS_AT_ONCE: Final = 20_000  # that are in memory as columns
PAGE_BYTES: Final = 16_384  # holds several runs; with SQLite's usual 4,096 hardly one
MAPPED_BYTES: Final = 1 << 28
_ALIKE: Final = operator.itemgetter(0, 6, 1, 2, 7)
_LINE: Final = "robot, connection, stream, seq, row, rows, session, layout, data, crc"
SUFFIXES: Final = ("", "-wal", "-shm")  # of the files that SQLite may make

# The last one: a statement of ours is refused, because the tables are not called as we have called them.
_DAMAGED: Final = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR)

_encoder = msgspec.msgpack.Encoder()
_layout_decoder = msgspec.msgpack.Decoder(Layout)
_record_decoder = msgspec.msgpack.Decoder(Record)


@functools.cache
def _made() -> dict[str, frozenset[str]]:
    """Return the columns of each table, as we make it."""
    with contextlib.closing(sqlite3.connect(":memory:")) as database:
        database.executescript(SCHEMA)
        return {table: _columns(database, table) for table in TABLES}


def _columns(database: sqlite3.Connection, table: str) -> frozenset[str]:
    return frozenset(column[1] for column in database.execute(f"PRAGMA table_info({table})"))


@contextlib.contextmanager
def translated(file: Path) -> Iterator[None]:
    """Turn what a file of the spool raises within the block into `SpoolUnusable`, or `Damaged`."""
    try:
        yield
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        # A file that we may write and that says it is only to be read does not say what we wrote.
        damaged = code in _DAMAGED or (code == sqlite3.SQLITE_READONLY and os.access(file, os.W_OK))
        kind, how = (Damaged, "is damaged") if damaged else (SpoolUnusable, "cannot be used")
        raise kind(f"the spool's file {file} {how}: {error}") from error
    except OSError as error:
        raise SpoolUnusable(f"the spool's file {file} cannot be used: {error.strerror or error}") from error
    except (msgspec.MsgspecError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise Damaged(f"the spool's file {file} is damaged: {error}") from error


class DamagedRun(NamedTuple):
    """Header of a damaged run, which may be wrong too."""

    number: int  # in its segment
    robot: str
    session: str
    connection: str
    stream: int
    seq: int
    rows: int


class DamagedRecord(NamedTuple):
    """A record that is not as it was written; whose it was only where that can still be read."""

    number: int
    robots: tuple[str, ...]  # any of these


class Segment:
    """A database of the spool, for one thread at a time.

    `writer` is who brings it to the store, by name; None in segments from before they said so.

    Raises:
        SpoolUnusable: the file cannot be used, or is not there and was `written` before.
        Damaged: it is no database, or is empty and was `written` before.

    """

    def __init__(self, path: Path, number: int, *, written: bool = False) -> None:
        self.path = path
        self.number = number
        self.rows = 0
        self._damaged: list[DamagedRun] | None = None  # as far as anybody has looked
        with translated(path):
            if written and not path.stat().st_size:  # else SQLite would begin it anew
                raise Damaged(f"the spool's file {path} is damaged: it is empty")
            path.touch(FILE)  # what SQLite puts beside it is as private as this is
            self._database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
            try:
                self._prepare()
            except BaseException:
                self._database.close()  # else the next close is not the last, and leaves the log behind
                raise

    def _prepare(self) -> None:
        self._database.execute(f"PRAGMA page_size={PAGE_BYTES}")
        self._database.execute(f"PRAGMA mmap_size={MAPPED_BYTES}")
        # WAL with FULL: a commit has returned only when the log is on the disk.
        self._database.execute("PRAGMA journal_mode=WAL")
        self._database.execute("PRAGMA synchronous=FULL")
        self._database.text_factory = _text
        self._database.executescript(SCHEMA)
        self._bring_forward()
        self._layouts: dict[tuple[str, Layout], int] = {}
        self._sums: dict[int, int] = {}  # of each layout, which its runs' checksums begin with
        for number, robot, description in self._database.execute("SELECT * FROM layout"):
            self._layouts[robot, _layout_decoder.decode(description)] = number
            self._sums[number] = of_layout(robot, description)
        self.rows = self._count()
        self.writer = self._told("writer")

    def _bring_forward(self) -> None:
        """Give a segment from before there were checksums room for them."""
        for table in ("run", "record", "journal_head"):
            if "crc" not in _columns(self._database, table):
                self._database.execute(f"ALTER TABLE {table} ADD COLUMN crc INTEGER")

    def check_columns(self) -> None:
        """Check the tables' schema; raises `Damaged`."""
        for table, wanted in _made().items():
            if wrong := wanted - _columns(self._database, table):
                missing = ", ".join(sorted(wrong))
                raise Damaged(f"the spool's file {self.path} is damaged: its table {table} has no {missing}")

    def name(self, writer: str) -> None:
        """Set the name of its writer at the store; while nothing is in it."""
        self._tell("began", str(time.time_ns()))
        self._tell("writer", writer)
        self.writer = writer

    @property
    def cut_commits(self) -> int:
        """Number of commits that may be missing at its end, because its log was damaged."""
        return int(self._told("cut") or 0)

    def cut(self, commits: int) -> None:
        """Note the number of missing commits."""
        self._tell("cut", str(commits))

    @property
    def began_utc_ns(self) -> int:
        """About when its first row came; the same whenever it is asked."""
        began = self._told("began")
        return self.path.stat().st_mtime_ns if began is None else int(began)

    def _tell(self, key: str, value: str) -> None:
        line = (key, value, zlib.crc32(f"{key}={value}".encode()))
        self._database.execute("INSERT OR REPLACE INTO meta VALUES (?, ?, ?)", line)

    def _told(self, key: str) -> str | None:
        found = self._database.execute("SELECT value, crc FROM meta WHERE key = ?", [key]).fetchone()
        if found is None:
            return None
        value, crc = found
        if crc != zlib.crc32(f"{key}={value}".encode()):
            raise Damaged(f"the spool's file {self.path} is damaged: its {key} is not as it was written")
        return str(value)

    def _count(self) -> int:
        runs = self._database.execute("SELECT coalesce(sum(rows), 0) FROM run").fetchone()[0]
        return int(runs + self._database.execute("SELECT count(*) FROM record").fetchone()[0])

    def append(
        self, runs: Sequence[Run], records: Sequence[Record], heads: Mapping[str, JournalHead]
    ) -> None:
        """Add all in one transaction; on the disk when this returns. `heads` replace those of their robots.

        Raises:
            sqlite3.Error: nothing was added.

        """
        self._damaged = None
        with self._transaction():
            self._database.executemany(
                f"INSERT INTO run ({_LINE}) VALUES ({', '.join('?' * 10)})",
                [self._line(run) for run in runs],
            )
            self._database.executemany(
                "INSERT INTO record (content, crc) VALUES (?, ?)",
                [(content, zlib.crc32(content)) for content in map(_encoder.encode, records)],
            )
            self._database.executemany(
                "INSERT OR REPLACE INTO journal_head (robot, n, hash, crc) VALUES (?, ?, ?, ?)",
                [(robot, head.n, head.hash, of_head(robot, head)) for robot, head in heads.items()],
            )
        self.rows += sum(map(len, runs)) + len(records)

    def _line(self, run: Run) -> tuple[object, ...]:
        first = (int(run.seqs[0]), int(run.rows[0]))
        layout = self._layout(run)
        name = (run.robot, run.connection, run.stream, *first, len(run), run.session, layout)
        data = pack(run)
        return (*name, data, of_run(self._sums[layout], name, data))

    def _layout(self, run: Run) -> int:
        number = self._layouts.get((run.robot, run.layout))
        if number is None:
            number = len(self._layouts) + 1
            description = _encoder.encode(run.layout)
            line = (number, run.robot, description)
            self._database.execute("INSERT INTO layout VALUES (?, ?, ?)", line)
            self._sums[number] = of_layout(run.robot, description)
            self._layouts[run.robot, run.layout] = number
        return number

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[None]:
        known = dict(self._layouts)
        try:
            self._database.execute("BEGIN IMMEDIATE")
            yield
            self._database.execute("COMMIT")
        except BaseException:
            self._layouts = known
            with contextlib.suppress(sqlite3.Error):
                self._database.execute("ROLLBACK")
            raise

    def layouts(self) -> list[tuple[str, Layout]]:
        """Return each robot with each of its layouts."""
        return list(self._layouts)

    def runs(self) -> Iterator[Run]:
        """Yield every row: robot by robot, connection by connection, stream by stream, in the order of `seq`.

        Without the runs that are `damaged`. What follows each other with the same name and columns is one
        run, up to `ROWS_AT_ONCE`.
        """
        layouts = {number: layout for (_, layout), number in self._layouts.items()}
        with translated(self.path):
            groups = itertools.groupby(self._lines(), _ALIKE)
            for (robot, session, connection, stream, layout), alike in groups:
                for data in _portions(alike):
                    yield unpack(robot, session, connection, stream, layouts[layout], data)

    def damaged(self) -> list[DamagedRun]:
        """Return the runs that are not as they were written: `runs` leaves them out."""
        with translated(self.path):
            if self._damaged is None:  # else somebody has read all of them already
                collections.deque(self._lines(), maxlen=0)
            return list(self._damaged or ())

    def _lines(self) -> Iterator[tuple[Any, ...]]:
        """Yield the runs that are sound; after the last one it is known which are not."""
        damaged = []
        sql = f"SELECT {_LINE}, rowid FROM run ORDER BY robot, connection, stream, seq, row"
        for line in self._database.execute(sql):
            if self._sound(line):
                yield line
            else:
                robot, connection, stream, seq, _, rows, session, *_, number = line
                damaged.append(
                    DamagedRun(number, str(robot), str(session), str(connection), stream, seq, rows)
                )
        self._damaged = damaged

    def _sound(self, line: tuple[Any, ...]) -> bool:
        """Return whether a run is as it was written, as far as anybody knows."""
        data, crc = line[DATA], line[DATA + 1]
        if not isinstance(data, bytes):
            return False
        return crc is None or crc == of_run(self._sums.get(line[DATA - 1], 0), line[:DATA], data)

    def records(self) -> Iterator[Record]:
        """Return every record in the order of recording, without those that are `damaged_records`."""
        return (record for _, record in self.numbered())

    def numbered(self) -> Iterator[tuple[int, Record]]:
        """Yield the same, each with its number: 0, 1, 2, …, also of those that are damaged."""
        with translated(self.path):
            for number, content, crc in self._contents():
                if unaltered(content, crc):
                    yield number, _record_decoder.decode(content)

    def damaged_records(self) -> list[DamagedRecord]:
        """Return the records that are not as they were written: `records` leaves them out."""
        with translated(self.path):
            found = [(n, content) for n, content, crc in self._contents() if not unaltered(content, crc)]
            return [DamagedRecord(number, self._whose(content)) for number, content in found]

    def _contents(self) -> Iterator[tuple[int, Any, int | None]]:
        return self._database.execute("SELECT rowid - 1, content, crc FROM record ORDER BY rowid")

    def robots(self) -> set[str]:
        """Return every robot of which something is recorded, now or before."""
        told = {str(record.fields["robot"]) for record in self.records() if record.fields.get("robot")}
        return {robot for robot, _ in self._layouts} | told | self._heads()[0].keys()

    def _whose(self, content: Any) -> tuple[str, ...]:
        """Return the possible robots of a record: its own, if it is a robot; else all."""
        known = self.robots()
        with contextlib.suppress(msgspec.MsgspecError, TypeError):
            told = _record_decoder.decode(content).fields.get("robot")
            known = {told} if told in known else known
        return tuple(sorted(known))

    def heads(self) -> dict[str, JournalHead]:
        """Return the newest journal entry of each robot that is known here.

        Where one is not as it was written, that is the newest of the entries that are here themselves.
        """
        found, are_whole = self._heads()
        if are_whole:
            return found
        log.error("%s is damaged: up to where a journal is recorded is looked for in its entries", self.path)
        entries = [record.fields for record in self.records() if record.table == JOURNAL.name]
        return {entry["robot"]: JournalHead(entry["n"], entry["hash"]) for entry in entries} | found

    def _heads(self) -> tuple[dict[str, JournalHead], bool]:
        """Return those that are as they were written, and whether these are all."""
        with translated(self.path):
            lines = self._database.execute("SELECT robot, n, hash, crc FROM journal_head").fetchall()
        told = [(robot, JournalHead(n, digest), crc) for robot, n, digest, crc in lines]
        found = {robot: head for robot, head, crc in told if crc in (None, of_head(robot, head))}
        return found, len(lines) == len(found)

    def close(self) -> None:
        """Let go of the file; SQLite brings its log home."""
        self._database.close()

    @staticmethod
    def remove(path: Path) -> None:
        """Delete the database's files."""
        for suffix in SUFFIXES:
            path.with_name(path.name + suffix).unlink(missing_ok=True)

    @staticmethod
    def size_bytes(path: Path) -> int:
        """Return the size of the database's files on the disk."""
        size = 0
        for suffix in SUFFIXES:
            with contextlib.suppress(FileNotFoundError):  # SQLite removes its log when it is closed
                size += path.with_name(path.name + suffix).stat().st_size
        return size


def _text(raw: bytes) -> str:
    """Also what is no text any more: its checksum tells."""
    return raw.decode(errors="replace")


def _portions(lines: Iterable[tuple[Any, ...]]) -> Iterator[bytes]:
    """Yield the packed rows of these lines, put together."""
    portion: list[bytes] = []
    rows = 0
    for line in lines:
        portion.append(line[DATA])
        rows += line[5]
        if rows >= ROWS_AT_ONCE:
            yield b"".join(portion)
            portion, rows = [], 0
    if portion:
        yield b"".join(portion)
