"""A session's telemetry as arrays, at a version of its table or as it is now."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset

from ml.features.windows import Samples
from ml.store.sessions import ORDER
from ml.store.store import Store
from ml.store.tables import TELEMETRY
from ml.store.translation import translated

Instants = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """Rows in the order of the robot's clock."""

    stamps_ns: Instants  # (n,) the robot's monotonic clock
    utc_ns: Instants  # (n,)
    values: Samples  # (n, channels), NaN where there was none

    def at_utc(self, instants_ns: Instants) -> Instants:
        """Instants of UTC (m,) on the robot's clock; raises `IndexError` where there is no row."""
        return _mapped(instants_ns, self.utc_ns, self.stamps_ns)

    def to_utc(self, stamps_ns: Instants) -> Instants:
        """Instants of the robot's clock (m,) in UTC, likewise."""
        return _mapped(stamps_ns, self.stamps_ns, self.utc_ns)


def recorded(
    store: Store, robot: str, session: str, channels: Sequence[str], version: int | None = None
) -> Recorded:
    """Return the session's rows with these channels, whatever is null in them.

    Raises:
        NoSuchTable: there is no such version.
        StoreError: it cannot be read.

    """
    location = TELEMETRY.location(robot, store.about.shards)
    known = store.dataset(location, version)
    there = [name for name in channels if name in known.schema.names]
    named = (pyarrow.dataset.field("robot") == robot) & (pyarrow.dataset.field("session") == session)
    with translated(f"the telemetry of {session} in {store.url} cannot be read"):
        table = known.to_table(columns=["utc", *(name for name, _ in ORDER), *there], filter=named).sort_by(
            ORDER
        )
    columns = [_values(table, name) for name in channels]
    values = np.stack(columns, axis=1) if columns else np.empty((table.num_rows, 0))
    return Recorded(table["stamp_ns"].to_numpy(), pc.cast(table["utc"], pa.int64()).to_numpy() * 1000, values)


def _values(table: pa.Table, name: str) -> npt.NDArray[np.float64]:
    if name not in table.column_names:
        return np.full(table.num_rows, np.nan)
    found: npt.NDArray[np.float64] = table[name].cast(pa.float64()).to_numpy()
    return found


def _mapped(instants: Instants, one: Instants, other: Instants) -> Instants:
    """Map from one clock to the other: the difference, small beside the times, is on a line between rows."""
    difference = other - one
    small = np.interp(instants - one[0], np.maximum.accumulate(one - one[0]), difference - difference[0])
    mapped: Instants = instants + difference[0] + np.rint(small).astype(np.int64)
    return mapped
