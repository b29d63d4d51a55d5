"""Rows of one store against those of another: which of them are new there, and which contradict."""

import contextlib
import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import pyarrow as pa

from ml.store import reading
from ml.store.errors import StoreError
from ml.store.store import Store
from ml.store.tables import SESSIONS, TELEMETRY, Table
from ml.store.translation import translated

if TYPE_CHECKING:
    import duckdb

ROWS_AT_ONCE: Final = 20_000
TOLD: Final = 3  # of contradictions
_CONFIG: Final[dict[str, str | bool | int | float | list[str]]] = {
    "enable_external_access": "false",
    "temp_directory": "",
}
_SETTINGS: Final = ("python_enable_replacements=false", "TimeZone='UTC'")


@dataclass(frozen=True, slots=True)
class Naming:
    """Identity of a row: two with these values are one, with the same `contents` (all, if empty)."""

    keys: tuple[str, ...]
    contents: tuple[str, ...] = ()


_OF_TELEMETRY: Final = Naming(("robot", "session", "connection", "stream", "seq", "row"))
_OF_A_SPOOL: Final = Naming(("spool", "batch", "number"))  # a row that has none is named by all that it says
_OF_A_SESSION: Final = Naming(("robot", "session"), ("began",))


def _naming(table: Table) -> Naming:
    return _OF_TELEMETRY if table is TELEMETRY else _OF_A_SPOOL


class Merge:
    """The rows of a table that have these values, in two stores."""

    def __init__(self, source: Store, target: Store, table: Table, values: Mapping[str, str]) -> None:
        self._source, self._target, self._table = source, target, table
        self._robot = values.get("robot")
        self._where = " AND ".join(f"{_quoted(name)} = {_text(value)}" for name, value in values.items())

    def check(self) -> None:
        """Check that rows and columns of both are the same; raises `StoreError`."""
        self._check_units()
        for naming in (_naming(self._table), *([_OF_A_SESSION] if self._table is SESSIONS else ())):
            with self._opened() as (connection, columns):
                found = connection.execute(_contradictions(naming, columns)).fetchall()
            if found:
                raise StoreError(
                    self._contradict([dict(zip(naming.keys, row, strict=True)) for row in found])
                )

    @contextlib.contextmanager
    def new(self) -> Iterator[pa.RecordBatchReader]:
        """Yield the source's rows that the target does not have."""
        with self._opened() as (connection, columns):
            schema = reading.dataset(self._source, self._table, self._robot).schema
            found = connection.sql(_new(_naming(self._table), columns, schema.names))
            with contextlib.closing(found.to_arrow_reader(ROWS_AT_ONCE)) as reader:
                yield reader.cast(schema)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[tuple["duckdb.DuckDBPyConnection", list[str]]]:
        """Both sides' rows as the views `ours` and `theirs`, with the same columns."""
        sides = {"ours": self._source, "theirs": self._target}
        with (
            translated(f"{self._source.url}/{self._table.name} cannot be compared with {self._target.url}"),
            contextlib.closing(_database().cursor()) as connection,
            _said(),
        ):
            for setting in _SETTINGS:
                connection.execute(f"SET {setting}")
            rows = {name: reading.dataset(store, self._table, self._robot) for name, store in sides.items()}
            columns = list(dict.fromkeys(name for side in rows.values() for name in side.schema.names))
            for name, side in rows.items():
                connection.register(f"all_{name}", side)
                connection.execute(_view(name, columns, side.schema.names, self._where))
            yield connection, columns

    def _check_units(self) -> None:
        ours, theirs = (
            reading.units(each, self._table, self._robot) for each in (self._source, self._target)
        )
        for name in ours.keys() & theirs.keys():
            if ours[name] != theirs[name]:
                raise StoreError(
                    f"{self._target.url}/{self._table.name} has {name} in {theirs[name] or 'no unit'}, and "
                    f"{self._source.url} in {ours[name] or 'no unit'}: copy to a folder of its own"
                )

    def _contradict(self, rows: list[dict[str, object]]) -> str:
        told = "; ".join(", ".join(f"{name} {value}" for name, value in row.items()) for row in rows)
        return (
            f"{self._target.url}/{self._table.name} has other contents than {self._source.url} by the same "
            f"name: {told}. Nothing was copied; copy to a folder of its own"
        )


@functools.cache
def _database() -> "duckdb.DuckDBPyConnection":
    """Empty for ever: each comparison has a cursor of its own, which costs a fortieth of a new database."""
    import duckdb  # of an extra that a collector does not need

    return duckdb.connect(config=_CONFIG)


@contextlib.contextmanager
def _said() -> Iterator[None]:
    import duckdb

    try:
        yield
    except duckdb.Error as error:
        raise OSError(str(error)) from None


def _view(name: str, columns: list[str], known: list[str], where: str) -> str:
    """Return a column that this side does not have is null."""
    have = set(known)
    chosen = ", ".join(_quoted(each) if each in have else f"NULL AS {_quoted(each)}" for each in columns)
    return f"CREATE TEMP VIEW {name} AS SELECT {chosen} FROM all_{name} WHERE {where}"


def _key(naming: Naming, columns: list[str]) -> str:
    whole = f"CASE WHEN {_quoted(naming.keys[0])} IS NULL THEN {_hash(columns)} END"
    return f"row({_list(naming.keys)}, {whole})"


def _contradictions(naming: Naming, columns: list[str]) -> str:
    said = f"{_key(naming, columns)} AS key, {_hash(naming.contents or columns)} AS contents"
    known = " AND ".join(f"{_quoted(name)} IS NOT NULL" for name in naming.contents) or "true"
    keys = ", ".join(f"o.{_quoted(name)}" for name in naming.keys)
    return (
        f"SELECT DISTINCT {keys} FROM (SELECT {_list(naming.keys)}, {said} FROM ours WHERE {known}) o "
        f"JOIN (SELECT {said} FROM theirs WHERE {known}) t ON o.key = t.key "
        f"WHERE o.contents <> t.contents ORDER BY ALL LIMIT {TOLD}"
    )


def _new(naming: Naming, columns: list[str], wanted: list[str]) -> str:
    key = _key(naming, columns)
    return f"SELECT {_list(wanted)} FROM ours WHERE {key} NOT IN (SELECT {key} FROM theirs)"


def _hash(columns: tuple[str, ...] | list[str]) -> str:
    return f"hash({_list(columns)})"


def _list(columns: tuple[str, ...] | list[str]) -> str:
    return ", ".join(map(_quoted, columns))


def _quoted(name: str) -> str:
    return '"{}"'.format(name.replace('"', '""'))


def _text(value: str) -> str:
    return "'{}'".format(value.replace("'", "''"))
