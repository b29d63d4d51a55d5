"""Rows as new Parquet files of a table, several made at a time, and what the table's log is to say of them.

The table format's library could write them too, for twice the CPU; and whoever has the files first can make
them last before the log names them.
"""

import itertools
import json
import time
import uuid
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import datetime
from typing import Any, Final
from urllib.parse import quote

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from deltalake.transaction import AddAction

from ml.store.objects import Objects
from ml.store.tables import Table

ROW_GROUP: Final = 100_000  # rows that are read or left out together; no file made here has more by far
AT_ONCE: Final = 2  # files that are made while the rows of the next ones are gathered

Partition = Mapping[str, str]  # column → value


def write(
    objects: Objects, table: Table, location: str, batches: Iterator[pa.RecordBatch]
) -> list[AddAction]:
    """Return new files with these rows, for a commit to name; before that nobody reads them.

    Raises:
        ValueError: a batch has rows of several partitions.
        StoreError: they cannot be written.

    """
    with ThreadPoolExecutor(AT_ONCE, "store") as pool:
        files: list[Future[AddAction]] = []
        for partition, rows in _portions(table, batches):
            if len(files) >= AT_ONCE:
                files[-AT_ONCE].result()  # so that only as many rows are in memory
            indexed = [name for name in table.schema.names[: table.indexed] if name not in partition]
            told = _statistics(rows.select(indexed))
            files.append(
                pool.submit(_file, objects, location, partition, rows.drop_columns([*partition]), told)
            )
        return [file.result() for file in files]


def _portions(table: Table, batches: Iterator[pa.RecordBatch]) -> Iterator[tuple[Partition, pa.Table]]:
    """Yield consecutive rows of one partition, as many as fit in a file."""
    filled = (batch for batch in batches if batch.num_rows)
    for partition, alike in itertools.groupby(filled, lambda batch: _partition(table, batch)):
        portion: list[pa.RecordBatch] = []
        count = 0
        for batch in alike:
            portion.append(batch)
            count += batch.num_rows
            if count >= ROW_GROUP:
                yield partition, pa.Table.from_batches(portion)
                portion, count = [], 0
        if portion:
            yield partition, pa.Table.from_batches(portion)


def _partition(table: Table, batch: pa.RecordBatch) -> Partition:
    values = {name: batch[name].unique().to_pylist() for name in table.partition_by}
    if any(len(found) > 1 for found in values.values()):
        raise ValueError(f"a batch of the table {table.name} has rows of one {', '.join(values)} only")
    return {name: found[0] for name, found in values.items()}


def _file(objects: Objects, location: str, partition: Partition, rows: pa.Table, told: str) -> AddAction:
    folders = [f"{name}={quote(value, safe='')}" for name, value in partition.items()]
    path = "/".join([*folders, f"part-{uuid.uuid4()}.zstd.parquet"])
    data = _encoded(rows)
    objects.put(f"{location}/{path}", data)
    written_ms = time.time_ns() // 1_000_000
    return AddAction(path, data.size, dict(partition), written_ms, True, told)


def _encoded(rows: pa.Table) -> pa.Buffer:
    """Return it as measured in docs/adr/0009; with statistics, which count the samples of a channel."""
    numbers = [field.name for field in rows.schema if pa.types.is_float64(field.type)]
    out = pa.BufferOutputStream()
    pq.write_table(
        rows,
        out,
        row_group_size=ROW_GROUP,
        compression="zstd",
        compression_level=1,
        use_dictionary=False,
        use_byte_stream_split=numbers,
        store_schema=False,
    )
    return out.getvalue()


def _statistics(rows: pa.Table) -> str:
    """Return statistics of the identifying columns, by which readers skip files."""
    extremes = {
        name: pc.min_max(column).as_py()
        for name, column in zip(rows.column_names, rows.columns, strict=True)
        if column.null_count < len(column)
    }
    return json.dumps(
        {
            "numRecords": rows.num_rows,
            "minValues": {name: _plain(found["min"]) for name, found in extremes.items()},
            "maxValues": {name: _plain(found["max"]) for name, found in extremes.items()},
            "nullCount": {name: rows[name].null_count for name in rows.column_names},
        }
    )


def _plain(value: Any) -> Any:
    """Return times as the format has them in a log: milliseconds, rounded downwards."""
    return f"{value:%Y-%m-%dT%H:%M:%S.%f}"[:-3] + "Z" if isinstance(value, datetime) else value
