"""Runs as the columns of the store's telemetry table."""

from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from ml.store.tables import TELEMETRY, UTC, field
from server_gui.core.recording.rows import Layout, Run


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

    def batch(self, run: Run) -> pa.RecordBatch:
        """A run's rows."""
        rows = len(run)
        found: dict[str, pa.Array] = {
            "robot": pa.repeat(run.robot, rows),
            "session": pa.repeat(run.session, rows),
            "utc": pa.array((run.stamps_ns + run.utc_offset_ns) // 1000).cast(UTC),
            "stamp_ns": pa.array(run.stamps_ns),
            "connection": pa.repeat(run.connection, rows),
            "stream": pa.array(np.full(rows, run.stream)),
            "seq": pa.array(run.seqs),
            "row": pa.array(run.rows),
        }
        layout = zip(run.layout.channels, run.layout.units, strict=True)
        found |= {self._names[key]: _nullable(column) for key, column in zip(layout, run.values, strict=True)}
        nothing = pa.nulls(rows, pa.float64())
        return pa.record_batch([found.get(name, nothing) for name in self.schema.names], schema=self.schema)


def _nullable(column: npt.NDArray[np.float64]) -> pa.Array:
    return pa.array(column, from_pandas=True)  # NaN, which is how a run says null, becomes null
