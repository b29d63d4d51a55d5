"""Whole tables for reading, whatever their shards, and their files as the log knows them."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final
from urllib.parse import unquote

import pyarrow as pa
import pyarrow.dataset

from ml.store.errors import NoSuchTable, translated
from ml.store.store import Store
from ml.store.tables import Table

_OF_THE_LOG: Final = {
    "path": "path",
    "rows": "num_records",
    "size_bytes": "size_bytes",
    "robot": "partition.robot",
    "session": "partition.session",
    "first": "min.utc",
    "last": "max.utc",
}
_ROUNDED_OFF: Final = timedelta(milliseconds=1)  # of a time in the log


@dataclass(frozen=True, slots=True)
class DataFile:
    """A file of a table as its log describes it; `path` is below the table's location.

    `robot` and `session` are its partition; all rows are from `first` to before `last`, which the log rounds
    to milliseconds. None where not known.
    """

    location: str
    path: str
    rows: int
    size_bytes: int
    robot: str | None
    session: str | None
    first: datetime | None
    last: datetime | None


def dataset(store: Store, table: Table, robot: str | None = None) -> pyarrow.dataset.Dataset:
    """The table's rows for pyarrow and duckdb, lazily. With `robot` only the shard that holds its rows."""
    found = []
    for location in _locations(store, table, robot):
        try:
            found.append(store.dataset(location))
        except NoSuchTable:
            continue
    if not found:
        return pyarrow.dataset.dataset(table.schema.empty_table())
    schema = pa.unify_schemas([shard.schema for shard in found])
    return pyarrow.dataset.dataset([shard.replace_schema(schema) for shard in found])


def units(store: Store, table: Table, robot: str | None = None) -> dict[str, str | None]:
    """Each column's unit, None where none was given."""
    found: dict[str, str | None] = {}
    for location in _locations(store, table, robot):
        found |= store.units(location)
    return found


def files(store: Store, table: Table, robot: str | None = None) -> Iterator[DataFile]:
    """Every file of the newest version, from the log alone."""
    for location in _locations(store, table, robot):
        try:
            delta = store.table(location)
        except NoSuchTable:
            continue
        with translated(f"{store.url}/{location} cannot be read"):
            log = pa.table(delta.get_add_actions(flatten=True))
        nothing = [None] * log.num_rows
        columns = {
            ours: log[theirs].to_pylist() if theirs in log.column_names else nothing
            for ours, theirs in _OF_THE_LOG.items()
        }
        columns["path"] = [unquote(path or "") for path in columns["path"]]
        columns["last"] = [last and last + _ROUNDED_OFF for last in columns["last"]]
        for values in zip(*columns.values(), strict=True):
            yield DataFile(location, **dict(zip(columns, values, strict=True)))


def _locations(store: Store, table: Table, robot: str | None) -> list[str]:
    shards = store.about.shards
    return table.locations(shards) if robot is None else [table.location(robot, shards)]
