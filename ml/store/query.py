"""SQL over the store's tables, for reading only: DuckDB, with everything but the tables locked away."""

import contextlib
import re
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from dataclasses import dataclass
from typing import Final, TypeVar

import duckdb
import pyarrow as pa

from ml.store import reading
from ml.store.errors import StoreError
from ml.store.precedence import OPENED
from ml.store.store import Store
from ml.store.tables import TABLES
from ml.store.translation import translated

Found = TypeVar("Found")
BATCH_ROWS: Final = 50_000
AGAIN_S: Final = 0.1  # between looks whether it has ended, and attempts to interrupt it
_CLOSED: Final[dict[str, str | bool | int | float | list[str]]] = {
    "enable_external_access": "false",  # no file, no network, no extension
    "autoinstall_known_extensions": "false",
    "autoload_known_extensions": "false",
    "temp_directory": "",
}
_SETTINGS: Final = ("python_enable_replacements=false", "TimeZone='UTC'", "lock_configuration=true")
_KIND: Final = re.compile(r"^(\w+ )*Error: ")
_READING: Final = "reading the Arrow source failed: IOError: "
_DOTTED: Final = re.compile(r'Referenced table "(\w+)" not found')

# Of rows of `labels`, as ml/store/labels.py and ml/store/precedence.py have it.
_ABOUT: Final = "robot, session, utc, ended, label, author, source"
_HOLDING: Final = f"""SELECT * FROM (SELECT * FROM every QUALIFY 1 = row_number() OVER (
    PARTITION BY {_ABOUT}, split_part(coalesce(spool, ''), '/', 1)
    ORDER BY regexp_extract(coalesce(spool, ''), '{OPENED}', 1) DESC,
    coalesce(batch, 0) DESC, coalesce(number, 0) DESC, written DESC NULLS LAST))
    QUALIFY NOT coalesce(removed, false)
    AND 1 = row_number() OVER (PARTITION BY {_ABOUT} ORDER BY written DESC NULLS LAST)"""


class QueryError(StoreError):
    """The SQL cannot be run; the message says why and where in it."""


@dataclass(frozen=True, slots=True)
class QueryResult:
    """Result of a query; the rows come while they are read."""

    schema: pa.Schema
    batches: Iterator[pa.RecordBatch]


@contextlib.contextmanager
def query(store: Store, sql: str, robot: str | None = None) -> Iterator[QueryResult]:
    """Run one SELECT over the tables `telemetry`, `sessions`, …, each as one view, whatever its shards.

    Of `labels` those that hold. Files, row groups and columns that the query does not need are not read. With
    `robot` the views hold that robot's rows only, and only its shard is opened.

    Raises:
        QueryError: it is no SELECT, or cannot be run.
        StoreError: the store cannot be read.

    """
    with contextlib.closing(duckdb.connect(config=_CLOSED)) as connection:
        with _said(store):
            kinds = [statement.type for statement in connection.extract_statements(sql)]
        if kinds != [duckdb.StatementType.SELECT]:
            raise QueryError("one SELECT at a time: a query only reads (SHOW TABLES and DESCRIBE do too)")
        for name in _asked(sql):
            with translated(f"{store.url}/{name} cannot be read"):
                rows = connection.from_arrow(reading.dataset(store, TABLES[name], robot))
            rows = rows if robot is None else rows.filter(_is("robot", robot))
            (_holding(rows) if "removed" in rows.columns else rows).create_view(name)
        for setting in _SETTINGS:
            connection.execute(f"SET {setting}")
        with _said(store):
            reader = _run(connection, lambda: _found(connection, sql))
        with contextlib.closing(reader):
            yield QueryResult(reader.schema, _read(reader, connection, store))


def _holding(labels: duckdb.DuckDBPyRelation) -> duckdb.DuckDBPyRelation:
    found = labels.query("every", _HOLDING)
    return labels if found is None else found  # None is for what is no SELECT


def _run(connection: duckdb.DuckDBPyConnection, work: Callable[[], Found]) -> Found:
    """Run a long query in a thread, so that Ctrl-C ends it."""
    outcome: Future[Found] = Future()
    thread = threading.Thread(target=_settle, args=(outcome, work), name="query")
    try:
        thread.start()  # Ctrl-C here too: the thread may have begun or not
        while not outcome.done():  # Ctrl-C just before a wait without end would be lost
            wait([outcome], AGAIN_S)
    finally:
        if not outcome.cancel():
            while not outcome.done():
                connection.interrupt()
                wait([outcome], AGAIN_S)
        if thread.ident is not None:
            thread.join()
    return outcome.result()


def _settle(outcome: "Future[Found]", work: Callable[[], Found]) -> None:
    if not outcome.set_running_or_notify_cancel():
        return
    try:
        outcome.set_result(work())
    except BaseException as error:  # noqa: BLE001 - whatever it is, who waits for it gets it
        outcome.set_exception(error)


def _found(connection: duckdb.DuckDBPyConnection, sql: str) -> pa.RecordBatchReader:
    try:
        return connection.sql(sql).to_arrow_reader(BATCH_ROWS)
    except (duckdb.BinderException, duckdb.CatalogException):
        connection.execute(sql)  # fails in the same way, and says where in the text
        raise


def _asked(sql: str) -> list[str]:
    """Return the tables whose names are in the text, or all: a table that is not opened costs nothing."""
    words = {word.lower() for word in re.findall(r"\w+", sql)}
    return [name for name in TABLES if name in words] or list(TABLES)


def _is(column: str, value: str) -> str:
    return "{} = '{}'".format(column, value.replace("'", "''"))


def _read(
    reader: pa.RecordBatchReader, connection: duckdb.DuckDBPyConnection, store: Store
) -> Iterator[pa.RecordBatch]:
    while True:
        try:
            with _said(store):
                batch = _run(connection, reader.read_next_batch)
        except StopIteration:
            return
        yield batch


@contextlib.contextmanager
def _said(store: Store) -> Iterator[None]:
    """DuckDB's errors in its words, which show the place, but for those of reading the store's files."""
    with translated(f"{store.url} cannot be read"):
        try:
            yield
        except duckdb.Error as error:
            if _READING in str(error):
                raise OSError(str(error).partition(_READING)[2]) from None
            text = re.sub(r"\n\n+", "\n", _KIND.sub("", str(error))).strip()
            if dotted := _DOTTED.search(text):
                text += f'\nA channel\'s name has a dot: write it in double quotes, "{dotted[1]}.…".'
            raise QueryError(text) from None
