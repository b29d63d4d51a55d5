"""Runs as the columns of the store's telemetry table."""

import itertools
from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from ml.store.tables import TELEMETRY, UTC, ColumnFacts, field
from server_gui.core.recording.rows import Layout, Run

OWN: Final = frozenset(TELEMETRY.schema.names)


class Columns:
    """Mapping of these layouts' channels to columns, in a table whose columns have these units already.

    A channel's column has its name. Where that column has another unit, because another robot means something
    else by the name, or none although this channel has one, it is `name@unit`: values in different units
    never stand in one column. Where the name is one of the table's own, another in other letters' case, which
    the table format takes for the same, or a column that is another channel's already, it is `name@2`. A
    column with such a name tells in its metadata whose it is; older ones do not.
    """

    def __init__(self, layouts: Iterable[Layout], there: Mapping[str, ColumnFacts]) -> None:
        self._there = {name.lower(): known for name, known in there.items()}  # what these tell stays
        self._columns = {name.lower(): (name, known.unit) for name, known in there.items()}
        self._whose = {name: known.channel for name, known in self._there.items() if known.channel}
        self._names: dict[tuple[str, str | None], str] = {}
        for layout in layouts:
            for key in zip(layout.channels, layout.units, strict=True):
                if key not in self._names:
                    self._names[key] = self._place(*key)
        channels = dict.fromkeys(self._names.values())
        self.schema = pa.schema(
            [
                *TELEMETRY.schema,
                *(self._field(name) for name in channels),
            ]
        )

    def _place(self, channel: str, unit: str | None) -> str:
        named = [channel] if unit is None else [channel, f"{channel}@{unit}"]
        further = (f"{channel}@{number}" for number in itertools.count(2))
        name = next(name for name in itertools.chain(named, further) if self._fits(name, unit, channel))
        known = self._columns.get(name.lower(), (name, None))[1]
        self._columns[name.lower()] = (name, unit if known is None else known)
        self._whose[name.lower()] = channel
        return name

    def _field(self, name: str) -> pa.Field:
        known = self._there.get(
            name.lower(), ColumnFacts(channel=self._whose[name.lower()] if "@" in name else None)
        )
        return field(name, pa.float64(), self._columns[name.lower()][1], known.channel)

    def _fits(self, name: str, unit: str | None, channel: str) -> bool:
        """Return whether values of this channel, in this unit, may stand in the column of this name."""
        if name.lower() in OWN or self._whose.get(name.lower(), channel) != channel:
            return False
        taken, known = self._columns.get(name.lower(), (name, None))
        open_ = known is None and name.lower() not in self._there
        return taken == name and (unit is None or open_ or known == unit)

    def batch(self, run: Run) -> pa.RecordBatch:
        """Return a run's rows."""
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
        found |= {self._names[key]: column for key, column in zip(layout, _nullable(run.values), strict=True)}
        nothing = pa.nulls(rows, pa.float64())
        return pa.record_batch([found.get(name, nothing) for name in self.schema.names], schema=self.schema)


def _nullable(values: npt.NDArray[np.float64]) -> list[pa.Array]:
    """Return an array a row; NaN is how a run says null. Without a copy where nothing is missing."""
    missing = np.isnan(values.sum(axis=1))
    return [
        pa.array(column, mask=np.isnan(column) if some else None)
        for column, some in zip(values, missing, strict=True)
    ]
