"""`gwrms query`: run SQL over all recordings."""

import itertools
import sys
from datetime import datetime
from decimal import Decimal
from typing import Final

import msgspec
import pyarrow as pa
import pyarrow.csv

from gateway.amounts import NONE
from gateway.cli.text import say, table, warn
from gateway.plain_text import json_plain
from ml.store.private import private_files
from ml.store.query import QueryResult, query
from server_gui.cli.cloud_options import add_url, parser, reach
from server_gui.core.cloud.tabular import iso_8601

SHOWN: Final = 100  # rows, for people
_PLAIN: Final = (
    pa.types.is_integer,
    pa.types.is_floating,
    pa.types.is_boolean,
    pa.types.is_string,
    pa.types.is_decimal,
    pa.types.is_null,
)
_encoder = msgspec.json.Encoder(decimal_format="number")
EPILOG = """The tables are telemetry, sessions, resources, events, journal, labels and predictions; their
columns are in gwrms docs store, and `gwrms query "DESCRIBE telemetry"` shows them. A channel is a
column; its name has a dot, so write it in double quotes. Name a robot and a time if you can: the rest is
not read.

examples
  gwrms query "SELECT robot, kind, count(*) FROM events GROUP BY ALL"
  gwrms query --csv "SELECT utc, \\"left_knee.position\\" FROM telemetry
      WHERE robot = 'exo-01' AND utc >= '2026-11-21 15:00Z'"

Read-only: no other statement, no file outside the store. Times are UTC."""


def main(argv: list[str]) -> int:
    """Run `gwrms query`."""
    private_files()
    made = parser("query", "Run SQL over the store's tables.", EPILOG)
    made.add_argument("sql", metavar="SELECT…", help="one statement, in DuckDB's SQL; - reads it from stdin")
    made.add_argument("--csv", action="store_true", help="CSV, every row")
    made.add_argument("--robot", metavar="NAME", help="only this robot's rows: opens its shard only")
    add_url(made)
    arguments = made.parse_args(argv)
    sql = sys.stdin.read() if arguments.sql == "-" else arguments.sql
    with query(reach(arguments), sql, arguments.robot) as result:
        if arguments.json:
            _json(result)
        elif arguments.csv:
            _csv(result)
        else:
            _table(result)
    return 0


def _json(result: QueryResult) -> None:
    """One array, a row a line, written while it is read."""
    between = "["
    for batch in result.batches:
        rows = ",\n".join(json_plain(_encoder.encode(row).decode()) for row in batch.to_pylist())
        if rows:
            sys.stdout.write(between + rows)
            between = ",\n"
    sys.stdout.write("]\n" if between != "[" else "[]\n")


def _csv(result: QueryResult) -> None:
    """Nothing for null, times as ISO 8601 has them, lists and structs as JSON."""
    schema = pa.schema(
        [(each.name, each.type if _is_plain(each.type) else pa.string()) for each in result.schema]
    )
    sys.stdout.flush()
    with pyarrow.csv.CSVWriter(sys.stdout.buffer, schema) as writer:
        for batch in result.batches:
            columns = [_flat(column) for column in batch.columns]
            writer.write_batch(pa.record_batch(columns, schema=schema))


def _is_plain(kind: pa.DataType) -> bool:
    """Return whether a CSV shows it as it is."""
    return any(is_kind(kind) for is_kind in _PLAIN)


def _flat(column: pa.Array) -> pa.Array:
    if _is_plain(column.type):
        return column
    if pa.types.is_timestamp(column.type) and column.type.tz:
        return iso_8601(column)
    return pa.array([None if value is None else _text(value) for value in column.to_pylist()], pa.string())


def _table(result: QueryResult) -> None:
    found = (
        (map(_text, row) for row in zip(*map(_list, batch.columns), strict=True)) for batch in result.batches
    )
    rows = [tuple(row) for row in itertools.islice(itertools.chain.from_iterable(found), SHOWN + 1)]
    say(table(result.schema.names, rows[:SHOWN]))
    if len(rows) > SHOWN:
        warn("query", f"the first {SHOWN} rows; --csv and --json bring all")


def _list(column: pa.Array) -> list[object]:
    values: list[object] = column.to_pylist()
    return values


def _text(value: object) -> str:
    """Return it for people."""
    if value is None:
        return NONE
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, datetime):
        return value.isoformat(sep=" ").replace("+00:00", "Z")
    if isinstance(value, str | int | Decimal):
        return str(value)
    return _encoder.encode(value).decode().strip('"')
