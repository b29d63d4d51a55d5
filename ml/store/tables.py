"""The store's tables: names, columns with units, and how they are laid out."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import pyarrow as pa

UTC: Final = pa.timestamp("us", "UTC")
_PROCESS: Final = pa.struct(
    [
        pa.field("pid", pa.int64()),
        pa.field("name", pa.string()),
        pa.field("cpu_percent", pa.float64()),  # of one core
        pa.field("memory_bytes", pa.int64()),
        pa.field("cmdline", pa.string()),
    ]
)


@dataclass(frozen=True, slots=True)
class Table:
    """One table. The first `indexed` columns have statistics in the log, so that files can be left out."""

    name: str
    meaning: str
    schema: pa.Schema
    indexed: int
    partition_by: tuple[str, ...] = ()
    sharded: bool = False  # several tables, chosen by the robot; see docs/explanation/scale.md

    def locations(self, shards: int) -> list[str]:
        """Return where it lies, below the store's URL."""
        return [f"{self.name}/{shard:03}" for shard in range(shards)] if self.sharded else [self.name]

    def location(self, robot: str, shards: int) -> str:
        """Return where this robot's rows lie."""
        return self.locations(shards)[shard_of(robot, shards)] if self.sharded else self.name

    def rows(self, fields: Sequence[Mapping[str, Any]]) -> pa.Table:
        """Return rows given as fields; times are integers in ns since 1970. What is not given is null.

        Raises:
            ValueError: a field that the table does not have, or a value of another type.

        """
        unknown = {name for row in fields for name in row} - set(self.schema.names)
        if unknown:
            raise ValueError(f"the table {self.name} has no {', '.join(sorted(unknown))}")
        try:
            return pa.table([self._column(column, fields) for column in self.schema], schema=self.schema)
        except (pa.ArrowInvalid, pa.ArrowTypeError) as error:
            raise ValueError(f"not a row of the table {self.name}: {error}") from error

    @staticmethod
    def _column(column: pa.Field, fields: Sequence[Mapping[str, Any]]) -> pa.Array:
        values = [row.get(column.name) for row in fields]
        if column.type == UTC:
            values = [None if value is None else value // 1000 for value in values]
        return pa.array(values, column.type)


def shard_of(robot: str, shards: int) -> int:
    """Return the number of the table with this robot, of `shards`; it never changes."""
    return zlib.crc32(robot.encode()) % shards


def field(name: str, kind: Any, unit: str | None = None, channel: str | None = None) -> pa.Field:
    """Make a column with its unit in its metadata, and its channel where the column's name may mislead."""
    told = {key: text for key, text in (("unit", unit), ("channel", channel)) if text is not None}
    return pa.field(name, kind, metadata=told or None)


class ColumnFacts(NamedTuple):
    """Facts about a column: its unit, empty without dimension, and the channel of its values."""

    unit: str | None = None
    channel: str | None = None


def columns(schema: pa.Schema) -> dict[str, ColumnFacts]:
    """Return the facts in the fields' metadata."""
    found: dict[str, ColumnFacts] = {}
    for each in schema:
        told = each.metadata or {}
        found[each.name] = ColumnFacts(
            *(told[key].decode() if key in told else None for key in (b"unit", b"channel"))
        )
    return found


# Which row of which server's spool it came from: what makes a row one, for ever.
_ORIGIN: Final = (field("spool", pa.string()), field("batch", pa.int64()), field("number", pa.int64()))
_WHOSE: Final = (field("robot", pa.string()), field("session", pa.string()), field("utc", UTC))

TELEMETRY: Final = Table(
    "telemetry",
    "a row a sample of a stream; further columns are its channels (float64), named as the robot names them",
    pa.schema(
        [
            *_WHOSE,
            field("stamp_ns", pa.int64(), "ns"),  # the robot's monotonic clock
            field("connection", pa.string()),
            field("stream", pa.int64()),
            field("seq", pa.int64()),
            field("row", pa.int64()),
        ]
    ),
    indexed=4,
    partition_by=("robot", "session"),
    sharded=True,
)
SESSIONS: Final = Table(
    "sessions",
    "a stretch of a recording and what was so when it began; of rows with one name, the newest holds",
    pa.schema(
        [
            *_WHOSE,
            field("began", UTC),
            field("ended", UTC),
            field("configuration_hash", pa.string()),
            *(field(name, pa.string()) for name in ("parameters", "units", "versions")),  # JSON
            field("operator", pa.string()),
            field("notes", pa.string()),
            *_ORIGIN,
            field("wearer", pa.string()),
            field("consent", pa.string()),
            field("setup", pa.string()),  # JSON
        ]
    ),
    indexed=5,
)
RESOURCES: Final = Table(
    "resources",
    "a look at a robot's computer and its processes",
    pa.schema(
        [
            *_WHOSE,
            field("stamp_ns", pa.int64(), "ns"),
            field("cpu_percent", pa.float64(), "%"),
            field("cpu_percent_per_core", pa.list_(pa.float64()), "%"),
            field("load", pa.list_(pa.float64())),
            *(
                field(f"memory_{name}", pa.int64(), "B")
                for name in ("total", "available", "used", "swap_used")
            ),
            field("gateway_cpu_percent", pa.float64(), "%"),
            field("gateway_rss", pa.int64(), "B"),
            field("processes", pa.list_(_PROCESS)),
            field("more", pa.string()),  # JSON: disk, network, thermal, kernel
            *_ORIGIN,
        ]
    ),
    indexed=4,
)
EVENTS: Final = Table(
    "events",
    "what happened to a robot or its recording: gaps, losses, markers",
    pa.schema(
        [
            *_WHOSE,
            field("stamp_ns", pa.int64(), "ns"),
            field("connection", pa.string()),
            *(field(name, pa.string()) for name in ("kind", "text", "data")),  # data: JSON
            *_ORIGIN,
        ]
    ),
    indexed=4,
)
JOURNAL: Final = Table(
    "journal",
    "the robots' own journals, entry by entry, with their hashes",
    pa.schema(
        [
            field("robot", pa.string()),
            field("utc", UTC),
            field("n", pa.int64()),
            *(field(name, pa.string()) for name in ("hash", "who", "what", "entry")),  # entry: JSON, whole
            *_ORIGIN,
            field("witness", pa.string()),  # JSON: the same as the robot signed it, where it has
        ]
    ),
    indexed=3,
)
LABELS: Final = Table(
    "labels",
    "what robot and wearer did from `utc` to `ended`, as somebody or something says; see labels.py",
    pa.schema(
        [
            *_WHOSE,
            field("ended", UTC),
            *(field(name, pa.string()) for name in ("label", "author", "source")),
            *_ORIGIN,
            field("written", UTC),
            field("removed", pa.bool_()),
        ]
    ),
    indexed=4,
)
PREDICTIONS: Final = Table(
    "predictions",
    "what a model made of the window that ended at `stamp_ns`",
    pa.schema(
        [
            *_WHOSE,
            field("stamp_ns", pa.int64(), "ns"),
            field("task", pa.string()),
            field("model", pa.string()),
            field("label", pa.string()),
            field("probability", pa.float64()),
            field("novelty", pa.float64()),
            *(field(name, pa.string()) for name in ("probabilities", "values")),  # JSON
            *_ORIGIN,
        ]
    ),
    indexed=4,
)
TABLES: Final = {
    table.name: table for table in (TELEMETRY, SESSIONS, RESOURCES, EVENTS, JOURNAL, LABELS, PREDICTIONS)
}
