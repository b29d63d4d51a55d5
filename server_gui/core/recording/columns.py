"""Runs as the columns of the store's telemetry table."""

import itertools
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from ml.store.tables import TELEMETRY, UTC, field
from server_gui.core.recording.rows import Layout, Run

ROWS_AT_ONCE: Final = 20_000  # that are in memory as columns


class Columns:
    """Where each channel of these layouts goes, in a table whose columns have these units already.

    A channel's column has its name. Where the column has another unit, because another robot means something
    else by that name, it is `name@unit`: values in different units never stand in one column.
    """

    def __init__(self, layouts: Iterable[Layout], units: Mapping[str, str | None]) -> None:
        taken = dict(units)
        self._names: dict[tuple[str, str | None], str] = {}
        for layout in layouts:
            for channel, unit in zip(layout.channels, layout.units, strict=True):
                name = channel if unit is None or taken.get(channel) in {None, unit} else f"{channel}@{unit}"
                taken[name] = unit if taken.get(name) is None else taken[name]
                self._names[channel, unit] = name
        channels = dict.fromkeys(self._names.values())
        self.schema = pa.schema(
            [*TELEMETRY.schema, *(field(name, pa.float64(), taken[name]) for name in channels)]
        )

    def batches(self, runs: Iterable[Run]) -> Iterator[pa.RecordBatch]:
        """The runs' rows in their order, of one robot, session and stream a batch."""
        for _, alike in itertools.groupby(runs, key=_kind):
            for some in _portions(alike):
                yield self._batch(some)

    def _batch(self, runs: list[Run]) -> pa.RecordBatch:
        first = runs[0]
        stamps_ns = np.concatenate([run.stamps_ns for run in runs])
        utc_ns = stamps_ns + np.concatenate([run.utc_offset_ns for run in runs])
        found: dict[str, pa.Array] = {
            "robot": pa.repeat(first.robot, len(stamps_ns)),
            "session": pa.repeat(first.session, len(stamps_ns)),
            "utc": pa.array(utc_ns // 1000).cast(UTC),
            "stamp_ns": pa.array(stamps_ns),
            "connection": pa.repeat(first.connection, len(stamps_ns)),
            "stream": pa.array(np.full(len(stamps_ns), first.stream)),
            "seq": pa.array(np.concatenate([run.seqs for run in runs])),
            "row": pa.array(np.concatenate([run.rows for run in runs])),
        }
        values = np.concatenate([run.values for run in runs], axis=1)
        layout = zip(first.layout.channels, first.layout.units, strict=True)
        found |= {self._names[key]: _nullable(column) for key, column in zip(layout, values, strict=True)}
        nothing = pa.nulls(len(stamps_ns), pa.float64())
        return pa.record_batch([found.get(name, nothing) for name in self.schema.names], schema=self.schema)


def _kind(run: Run) -> tuple[str, str, str, int, Layout]:
    return (run.robot, run.session, run.connection, run.stream, run.layout)


def _portions(runs: Iterable[Run]) -> Iterator[list[Run]]:
    portion: list[Run] = []
    rows = 0
    for run in runs:
        portion.append(run)
        rows += len(run)
        if rows >= ROWS_AT_ONCE:
            yield portion
            portion, rows = [], 0
    if portion:
        yield portion


def _nullable(column: npt.NDArray[np.float64]) -> pa.Array:
    return pa.array(column, from_pandas=True)  # NaN, which is how a run says null, becomes null
