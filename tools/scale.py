"""`python tools/scale.py URL`: how long a store's commits, listings and compactions take, and what follows.

The figures of docs/scale.md. The URL must be of a store of its own: it is written to.
"""

import functools
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pyarrow as pa

from ml.store import TELEMETRY, Store
from ml.store.tables import field
from ml.store.upkeep import compact

CHANNELS, ROBOTS_A_SERVER, COMMITS, MINUTES = 60, 100, 20, 5
FLEETS = (20, 200, 1_000, 10_000)
BATCH_S, COMPACT_S = 60, 3600
SCHEMA = pa.schema([*TELEMETRY.schema, *(field(f"c.{n}", pa.float64(), "rad") for n in range(CHANNELS))])


@dataclass(frozen=True, slots=True)
class Measured:
    """Seconds on this store."""

    commit: float  # one robot's rows
    file: float  # each further robot in a commit
    open: float  # of a table, each file
    compact: float  # each file


def batches(robots: int, minute: int) -> Iterator[pa.RecordBatch]:
    """A second of each robot: what is measured here is the cost of files, not of their bytes."""
    rows = 100
    numbers = pa.array(range(minute * rows, (minute + 1) * rows), pa.int64())
    for robot in range(robots):
        keys = {"robot": f"exo-{robot}", "session": "s-1", "connection": "c-1"}
        columns = [
            pa.repeat(keys[name.name], rows) if name.name in keys else numbers.cast(name.type)
            for name in SCHEMA
        ]
        yield pa.record_batch(columns, schema=SCHEMA)


def measure(url: str) -> Measured:
    """A small fleet of one server, some minutes of it."""
    store = Store(url, shards=2)
    single, many = TELEMETRY.locations(2)
    commits = [
        took(
            functools.partial(
                store.append, TELEMETRY, single, SCHEMA, functools.partial(batches, 1, n), "one", n
            )
        )
        for n in range(1, COMMITS + 1)
    ]
    fleet = [
        took(
            functools.partial(
                store.append,
                TELEMETRY,
                many,
                SCHEMA,
                functools.partial(batches, ROBOTS_A_SERVER, n),
                "all",
                n,
            )
        )
        for n in range(1, MINUTES + 1)
    ]
    files = ROBOTS_A_SERVER * MINUTES
    commit = statistics.median(commits)
    opened = took(lambda: store.table(many))
    compacted = took(lambda: compact(store, [TELEMETRY]))
    return Measured(
        commit,
        (statistics.median(fleet) - commit) / ROBOTS_A_SERVER,
        opened / files,
        compacted / (files + COMMITS),
    )


def took(work: Callable[[], object]) -> float:
    """Seconds."""
    began_s = time.perf_counter()
    work()
    return time.perf_counter() - began_s


def main() -> int:
    """Print the measured latencies and the loads that follow, as fractions of the time there is."""
    found = measure(sys.argv[1])
    sys.stdout.write(
        f"commit {1e3 * found.commit:.0f} ms, each further robot in it {1e3 * found.file:.1f} ms, "
        f"opening a table {1e6 * found.open:.0f} µs a file, "
        f"compaction {1e3 * found.compact:.1f} ms a file"
        "\n\n| robots | shards | a table's commits | a server's upload "
        "| a table's files an hour | its compaction |\n"
        "|---|---|---|---|---|---|\n"
    )
    for robots in FLEETS:
        for shards in sorted({1, -(-robots // ROBOTS_A_SERVER)}):
            sys.stdout.write(line(found, robots, shards))
    return 0


def line(found: Measured, robots: int, shards: int) -> str:
    """One fleet: the robots of a shard belong to one server; with one shard, every server writes to it.

    A table takes one commit after another, so all servers' commits to it share the batch's time.
    """
    servers = -(-robots // ROBOTS_A_SERVER)
    writers = servers // shards if shards > 1 else servers
    commits = writers * found.commit / BATCH_S
    upload = (found.commit * writers + found.file * min(robots, ROBOTS_A_SERVER)) / BATCH_S
    files = robots / shards * COMPACT_S / BATCH_S
    compaction = files * found.compact / COMPACT_S
    return f"| {robots:,} | {shards} | {commits:.1%} | {upload:.1%} | {files:,.0f} | {compaction:.0%} |\n"


if __name__ == "__main__":
    sys.exit(main())
