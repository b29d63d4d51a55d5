"""A session as one table in a file: CSV or Parquet, with the channels' units."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from ml.store.sessions import KEYS, Channel
from ml.store.tables import TELEMETRY, field
from server_gui.core.atomic_files import draft
from server_gui.core.cloud.selection import SelectedRecording


def write_csv(file: Path, recording: SelectedRecording) -> int:
    """Columns like `left_knee.position [rad]`; a value that is missing is empty. How many rows."""
    schema = _schema(recording.channels)
    names = [f"{each.name} [{unit}]" if (unit := _unit(each)) else each.name for each in schema]
    kinds = [pa.string(), *schema.types[1:]]
    with (
        draft(file) as written,
        pyarrow.csv.CSVWriter(written, pa.schema(zip(names, kinds, strict=True))) as writer,
    ):
        texts = (table.set_column(0, KEYS[0], iso_8601(table[KEYS[0]])) for table in recording.tables)
        return _write(writer, (table.rename_columns(names) for table in texts))


def iso_8601(utc: pa.ChunkedArray | pa.Array) -> pa.ChunkedArray | pa.Array:
    """Return times in UTC as `gwrms watch` writes them.

    Arrow's own way, by time zones, takes ten times as long.
    """
    spaced = utc.cast(pa.timestamp(utc.type.unit)).cast(pa.string())
    text = pc.replace_substring(spaced, " ", "T", max_replacements=1)
    return pc.binary_join_element_wise(text, "Z", "")


def write_parquet(file: Path, recording: SelectedRecording) -> int:
    """Write a column a channel, with units and session in the metadata; return how many rows."""
    schema = _schema(recording.channels).with_metadata({"session": msgspec.json.encode(recording.session)})
    with draft(file) as written, pq.ParquetWriter(written, schema, compression="zstd") as writer:
        return _write(writer, (table.cast(schema) for table in recording.tables))


def _write(writer: pq.ParquetWriter | pyarrow.csv.CSVWriter, tables: Iterable[pa.Table]) -> int:
    rows = 0
    for table in tables:
        writer.write_table(table)
        rows += table.num_rows
    return rows


def _schema(channels: Sequence[Channel]) -> pa.Schema:
    keys = [TELEMETRY.schema.field(name) for name in KEYS]
    return pa.schema([*keys, *(field(each.name, pa.float64(), each.unit) for each in channels)])


def _unit(column: pa.Field) -> str:
    unit: bytes = (column.metadata or {}).get(b"unit", b"")
    return unit.decode()
