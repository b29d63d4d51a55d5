"""`gwrms query`: SQL over everything recorded."""

import csv
import itertools
import sys
from collections.abc import Iterable, Iterator
from datetime import datetime
from decimal import Decimal
from typing import Any, Final

import msgspec

from gateway.cli.text import NONE, say, table, warn
from ml.store.query import Result, query
from server_gui.commands.cloud_reach import add_url, parser, reach

SHOWN: Final = 100  # rows, for people
EPILOG = """The tables are telemetry, sessions, resources, events, journal, labels and predictions; their
columns are in docs/store.md, and `gwrms query "DESCRIBE telemetry"` shows them. A channel is a column; its
name has a dot, so write it in double quotes. Name a robot and a time where you can: the rest is not read.

examples
  gwrms query "SELECT robot, kind, count(*) FROM events GROUP BY ALL"
  gwrms query --csv 'SELECT utc, "left_knee.position" FROM telemetry
      WHERE robot = '"'exo-01'"' AND utc >= '"'2026-11-21 15:00:00Z'"''

Only reading: no other statement, no file outside the store. Times are UTC."""


def main(argv: list[str]) -> int:
    """Run `gwrms query`."""
    made = parser("query", "SQL over the store's tables.", EPILOG)
    made.add_argument("sql", metavar="SELECT…", help="one statement, in DuckDB's SQL; - reads it from stdin")
    made.add_argument("--csv", action="store_true", help="CSV, every row")
    made.add_argument("--robot", metavar="NAME", help="this robot's rows alone: opens its shard alone")
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


def _json(result: Result) -> None:
    """One array, a row a line, written while it is read."""
    encoder = msgspec.json.Encoder(decimal_format="number")
    before = "["
    for batch in result.batches:
        for row in batch.to_pylist():
            sys.stdout.write(f"{before}{encoder.encode(row).decode()}")
            before = ",\n"
    sys.stdout.write("]\n" if before != "[" else "[]\n")


def _csv(result: Result) -> None:
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(result.schema.names)
    for batch in result.batches:
        writer.writerows(_rows([batch], _plain))


def _table(result: Result) -> None:
    rows = list(itertools.islice(_rows(result.batches, _short), SHOWN + 1))
    say(table(result.schema.names, rows[:SHOWN]))
    if len(rows) > SHOWN:
        warn("query", f"the first {SHOWN} rows; --csv and --json bring all")


def _rows(batches: Iterable[Any], text: Any) -> Iterator[tuple[str, ...]]:
    for batch in batches:
        columns = (column.to_pylist() for column in batch.columns)
        for row in zip(*columns, strict=True):
            yield tuple(map(text, row))


def _short(value: object) -> str:
    if value is None:
        return NONE
    return f"{value:.6g}" if isinstance(value, float) else _plain(value)


def _plain(value: object) -> str:
    """As CSV has it: nothing for null, ISO 8601 for times, JSON for lists and structs."""
    if value is None:
        return ""
    if isinstance(value, datetime):
        return value.isoformat(sep=" ").replace("+00:00", "Z")
    return (
        str(value) if isinstance(value, str | int | float | Decimal) else msgspec.json.encode(value).decode()
    )
