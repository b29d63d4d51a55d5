"""`./dev bench query`: ten channels of an hour out of a month of one robot, beside a plain pyarrow scan.

The hour that is asked for is a real one. The files of the other hours are further names of it; in the log
each has its own times, as after an hourly compaction. None of them may be read.
"""

import functools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.dataset
from deltalake.transaction import AddAction, RemoveAction

from ml.store import TELEMETRY, Store, reading
from ml.store.fragments import DataFile
from ml.store.query import query
from ml.store.upkeep import compact
from server_gui.core.recording.columns import Columns
from tests.bench.server import LAYOUT, NAMES, RATE_HZ, Row, run

HOURS = 30 * 24
ASKED = HOURS // 2
HOUR = timedelta(hours=1)
BEGAN = datetime(2026, 10, 1, tzinfo=UTC)
ROBOT, SESSION = "exo-00", "s-1"
ROUNDS = 5
MOST_S = 2.0
CHANNELS = NAMES[:10]


def batches(columns: Columns) -> Iterator[pa.RecordBatch]:
    """The hour, a minute at a time."""
    offset_ns = int((BEGAN + ASKED * HOUR).timestamp()) * 10**9
    for minute in range(60):
        rows = 60 * RATE_HZ
        made = run(0, minute * rows, rows)
        np.copyto(made.utc_offset_ns, offset_ns)
        yield columns.batch(made)


def month(folder: Path) -> Store:
    """A store with every hour of a month."""
    store = Store(folder.as_uri())
    columns = Columns([LAYOUT], {})
    location = TELEMETRY.location(ROBOT, 1)
    store.append(TELEMETRY, location, columns.schema, functools.partial(batches, columns), "bench", 1)
    compact(store, [TELEMETRY])
    delta = store.table(location)
    actions: list[AddAction | RemoveAction] = [
        _linked(folder / location, file, hour - ASKED)
        for file in reading.files(store, TELEMETRY)
        for hour in range(HOURS)
        if hour != ASKED
    ]
    delta.create_write_transaction(actions, "append", delta.schema(), ["robot", "session"])
    delta.create_checkpoint()
    return store


def _linked(table: Path, file: DataFile, hours: int) -> AddAction:
    """The same file under another name, as if it were of so many hours later."""
    original = table / file.path
    linked = original.with_name(f"{hours + ASKED:03}-{original.name}")
    linked.hardlink_to(original)
    assert file.first is not None
    assert file.last is not None
    first, last = (
        f"{time + hours * HOUR:%Y-%m-%dT%H:%M:%S.%f}"[:-3] + "Z" for time in (file.first, file.last)
    )
    stats = {
        "numRecords": file.rows,
        "minValues": {"utc": first},
        "maxValues": {"utc": last},
        "nullCount": {"utc": 0},
    }
    values = {"robot": ROBOT, "session": SESSION}
    return AddAction(str(linked.relative_to(table)), file.size_bytes, values, 0, True, json.dumps(stats))


def sql() -> str:
    names = ", ".join(f'"{name}"' for name in CHANNELS)
    begin, end = BEGAN + ASKED * HOUR, BEGAN + (ASKED + 1) * HOUR
    return (
        f"SELECT utc, {names} FROM telemetry WHERE robot = '{ROBOT}' AND utc >= '{begin}' AND utc < '{end}'"
    )


def ask(url: str) -> int:
    """As a script does: how many rows."""
    with query(Store.existing(url), sql()) as found:
        return sum(batch.num_rows for batch in found.batches)


def plain(files: list[str]) -> int:
    """The hour's own files, known beforehand."""
    rows: int = pyarrow.dataset.dataset(files).to_table(columns=["utc", *CHANNELS]).num_rows
    return rows


def command(url: str) -> int:
    """A new process that writes CSV to nowhere."""
    words = [str(Path(sys.executable).with_name("gwrms")), "query", "--csv", "--url", url, sql()]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    return 3600 * RATE_HZ


def took_s(work: Callable[[], int]) -> float:
    """The median of some times; raises where not every row of the hour came."""
    found: list[float] = []
    for _ in range(ROUNDS):
        began_s = time.perf_counter()
        rows = work()
        found.append(time.perf_counter() - began_s)
        if rows != 3600 * RATE_HZ:
            raise RuntimeError(f"{rows} rows instead of {3600 * RATE_HZ}")
    return statistics.median(found)


def measured(folder: Path) -> Iterator[Row]:
    """The rows of the table."""
    store = month(folder)
    files = list(reading.files(store, TELEMETRY))
    begin, end = BEGAN + ASKED * HOUR, BEGAN + (ASKED + 1) * HOUR
    here = [file for file in files if file.first and begin <= file.first < end]
    began_s = time.process_time()
    asked_s = took_s(functools.partial(ask, store.url))
    cpu_s = (time.process_time() - began_s) / ROUNDS
    plain_s = took_s(functools.partial(plain, [str(folder / file.location / file.path) for file in here]))
    millions = sum(file.rows for file in files) / 1e6
    gigabytes = sum(file.size_bytes for file in files) / 1e9
    yield Row(f"{len(CHANNELS)} of {len(NAMES)} channels, an hour of a month", asked_s, "s", MOST_S, True)
    yield Row("  CPU of it", cpu_s, "s")
    yield Row("  the month: files", len(files), "")
    yield Row("  the month: million rows", millions, "")
    yield Row("  the month: size", gigabytes, "GB")
    yield Row("  pyarrow, told in which files the hour is", plain_s, "s")
    yield Row("  ratio", asked_s / plain_s, "×")
    whole_s = took_s(functools.partial(command, store.url))
    yield Row("  gwrms query --csv, a process of its own", whole_s, "s")


def main() -> int:
    """Print the table; 1 where a limit was not kept."""
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    sys.stdout.write(f"Queries; load of this machine before: {load:.1f} a core; medians of {ROUNDS}\n")
    with tempfile.TemporaryDirectory() as folder:
        rows = list(measured(Path(folder)))
    sys.stdout.write("".join(row.text for row in rows))
    return 0 if all(row.kept for row in rows) else 1
