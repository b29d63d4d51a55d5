"""`./dev bench server`: spool, store and the memory they take, beside plain Parquet in the same run."""

import functools
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.dataset
import pyarrow.parquet as pq

from ml.store import Store
from ml.store.tables import TELEMETRY
from server_gui.core.recording.rows import Layout, Run
from server_gui.core.recording.segment import Segment
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import upload
from tests.bench import _fleet

ROBOTS, CHANNELS, RATE_HZ, SECONDS = 20, 60, 100, 60
NAMES = tuple(f"joint_{number // 6}.quantity_{number % 6}" for number in range(CHANNELS))
LAYOUT = Layout(NAMES, ("rad",) * CHANNELS)
ASKED = [*NAMES[:10], "utc"]
GROUP_ROWS = 200  # of one commit
ROUNDS = 5
LEAST_ROWS_PER_S, MOST_UPLOAD_S = 40_000, 0.5
FLEET, MOST_CORES, MOST_GROWTH = 50, 1.0, 1.2


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table; `limit` is what `value` must reach, or must not pass where `most`."""

    what: str
    value: float
    unit: str
    limit: float | None = None
    most: bool = False

    @property
    def kept(self) -> bool:
        return self.limit is None or (self.value <= self.limit if self.most else self.value >= self.limit)

    @property
    def text(self) -> str:
        asked = "" if self.limit is None else f"{'≤' if self.most else '≥'} {self.limit:,g}"
        return f"{self.what:<72}{self.value:>14,.4g} {self.unit:<8}{asked}\n"


def run(robot: int, begin: int, rows: int) -> Run:
    """Rows as joints move: sines with the noise of an encoder."""
    numbers = np.arange(begin, begin + rows)
    noise = np.random.default_rng(robot).normal(0, 1e-4, (CHANNELS, rows))
    values = np.sin(numbers / 100 + np.arange(CHANNELS)[:, None]) + noise
    stamps_ns = numbers * 10_000_000
    offset_ns = np.full(rows, 1_700_000_000_000_000_000)
    name = f"exo-{robot:02}"
    return Run(name, "s-1", "c-1", 1, LAYOUT, stamps_ns, numbers, numbers * 0, offset_ns, values)


def spool(folder: Path) -> Iterator[Row]:
    """What the disk takes: commits of 200 rows, ten of each of twenty robots."""
    rows = GROUP_ROWS // ROBOTS
    groups = [[run(robot, begin, rows) for robot in range(ROBOTS)] for begin in range(0, 2_000, rows)]
    took_s: list[float] = []
    with Spool(folder / "rate") as opened:
        began_s = time.perf_counter()
        for group in groups:
            commit_s = time.perf_counter()
            opened.append(group, [])
            took_s.append(time.perf_counter() - commit_s)
        rate = len(groups) * GROUP_ROWS / (time.perf_counter() - began_s)
    cuts = statistics.quantiles(took_s, n=100)
    what = f"spool: {CHANNELS} channels, {GROUP_ROWS} rows a commit, synchronised"
    yield Row(what, rate, "rows/s", LEAST_ROWS_PER_S)
    yield Row("  commit p50", 1e3 * cuts[49], "ms")
    yield Row("  commit p99", 1e3 * cuts[98], "ms")


def stored(folder: Path) -> Iterator[Row]:
    """A minute of twenty robots into a store, and out of it, beside plain Parquet."""
    with Spool(folder / "spool") as opened:
        for begin in range(0, RATE_HZ * SECONDS, 5):  # as the recorder commits it, 20 times a second
            opened.append([run(robot, begin, 5) for robot in range(ROBOTS)], [])
        opened.freeze()
        segment = opened.read(1)
        rows = ROBOTS * RATE_HZ * SECONDS
        uploads_s, plains_s, cpus_s = [], [], []
        for number in range(ROUNDS):
            store = Store((folder / f"store-{number}").as_uri())
            cpu_s = time.process_time()
            uploads_s.append(_took_s(functools.partial(upload, segment, opened.id, store)))
            cpus_s.append(time.process_time() - cpu_s)
            plains_s.append(_took_s(functools.partial(_plain, segment, folder / f"plain-{number}")))
        segment.close()
    what = f"{SECONDS} s × {ROBOTS} robots × {CHANNELS} channels, spool → "
    yield Row(
        f"{what}store, synchronised: median of {ROUNDS}",
        statistics.median(uploads_s),
        "s",
        MOST_UPLOAD_S,
        True,
    )
    yield Row("  best", min(uploads_s), "s")
    yield Row("  CPU of it: median", statistics.median(cpus_s), "s")
    yield Row(f"{what}plain Parquet (pyarrow's defaults): median", statistics.median(plains_s), "s")
    yield Row("  store's size", _size(folder / "store-0") / 1e6, "MB")
    yield Row("  plain Parquet's size", _size(folder / "plain-0") / 1e6, "MB")
    ours = Store((folder / "store-0").as_uri()).dataset(TELEMETRY.locations(1)[0])
    plain = pyarrow.dataset.dataset(folder / "plain-0")
    for name, source in (("store", ours), ("plain Parquet", plain)):
        best_s = min(_took_s(functools.partial(source.to_table, columns=ASKED)) for _ in range(ROUNDS))
        yield Row(f"scan of {len(ASKED)} columns: {name}", rows / best_s, "rows/s")


def fleet(folder: Path) -> Iterator[Row]:
    """What it costs to follow robots over TCP and keep everything: nothing is lost, and nothing grows."""
    cost = _fleet.cpu(FLEET)
    what = f"{FLEET} robots × {RATE_HZ} Hz × {CHANNELS} channels: followed, recorded, uploaded"
    yield Row(what, cost["cores"], "cores", MOST_CORES, True)
    yield Row("  rows lost", cost["lost"], "", 0, True)
    found = _fleet.memory(ROBOTS)
    parts = [found[str(part)] for part in range(1, _fleet.PARTS + 1)]
    what = (
        f"an hour's batches of {ROBOTS} robots, in {_fleet.COLLECT_S:g} s: last half hour's memory ÷ first's"
    )
    yield Row(what, max(parts[3:]) / max(parts[:3]), "", MOST_GROWTH, True)
    for part, megabytes in enumerate(parts, 1):
        yield Row(f"  {10 * part} minutes", megabytes, "MB")
    yield Row("  batches uploaded", found["batches"], "")
    yield Row("  rows lost", found["lost"], "", 0, True)


MEASUREMENTS: tuple[Callable[[Path], Iterator[Row]], ...] = (spool, stored, fleet)


def main() -> int:
    """Print the table; 1 where a limit was not kept."""
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    sys.stdout.write(f"Server; load of this machine before: {load:.1f} a core\n")
    rows: list[Row] = []
    for measure in MEASUREMENTS:
        with tempfile.TemporaryDirectory() as folder:
            for row in measure(Path(folder)):
                rows.append(row)
                sys.stdout.write(row.text)
                sys.stdout.flush()
    return 0 if all(row.kept for row in rows) else 1


def _plain(segment: Segment, folder: Path) -> None:
    """The same columns by pyarrow alone: a file a robot, nothing synchronised, nothing committed."""
    folder.mkdir()
    for found in segment.runs():  # one a robot
        keys = {"robot": pa.repeat(found.robot, len(found)), "utc": pa.array(found.stamps_ns)}
        channels = dict(zip(NAMES, found.values, strict=True))
        pq.write_table(pa.table(keys | channels), folder / f"{found.robot}.parquet")


def _took_s(work: Callable[[], object]) -> float:
    began_s = time.perf_counter()
    work()
    return time.perf_counter() - began_s


def _size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*.parquet"))


if __name__ == "__main__":
    sys.exit(main())
