"""Whole tables for reading, whatever their shards, and their files as the log knows them."""

from collections.abc import Iterator

import pyarrow as pa
import pyarrow.dataset

from ml.store.errors import NoSuchTable
from ml.store.fragments import DataFile, data_files
from ml.store.store import Store
from ml.store.tables import Table
from ml.store.translation import translated


def dataset(store: Store, table: Table, robot: str | None = None) -> pyarrow.dataset.Dataset:
    """Return the table's rows for pyarrow and duckdb, lazily; with `robot` those of its shard alone."""
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
    """Return each column's unit, None where none was given."""
    found: dict[str, str | None] = {}
    for location in _locations(store, table, robot):
        found |= store.units(location)
    return found


def files(store: Store, table: Table, robot: str | None = None) -> Iterator[DataFile]:
    """Yield every file of the newest version, from the log alone."""
    for location in _locations(store, table, robot):
        try:
            delta = store.table(location)
        except NoSuchTable:
            continue
        with translated(f"{store.url}/{location} cannot be read"):
            yield from data_files(delta, location)


def _locations(store: Store, table: Table, robot: str | None) -> list[str]:
    shards = store.about.shards
    return table.locations(shards) if robot is None else [table.location(robot, shards)]
