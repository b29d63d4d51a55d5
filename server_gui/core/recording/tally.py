"""Counts and sums of what a batch has in a table, for its receipt."""

from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ml.store import sums
from server_gui.core.recording.missing_rows import numbers_alone
from server_gui.core.recording.receipts import Part, Stream

_Name = tuple[str, str, str, int]  # robot, session, connection, stream


@dataclass(slots=True)
class _Counted:
    first: int
    last: int
    begin_us: int
    end_us: int
    rows: int = 0
    sum: int = 0


@dataclass(slots=True)
class Tally:
    """Of runs of telemetry, a stream at a time."""

    _streams: dict[_Name, _Counted] = field(default_factory=dict)

    def clear(self) -> None:
        """Begin anew."""
        self._streams.clear()

    def add(self, batch: pa.RecordBatch) -> None:
        """Count a run."""
        mine, same = numbers_alone(batch)
        seqs = batch["seq"].to_numpy()
        times = batch["utc"].cast(pa.int64()).to_numpy()
        name = (same["robot"], same["session"], same["connection"], batch["stream"][0].as_py())
        ends = (int(seqs[0]), int(seqs[-1]), int(times.min()), int(times.max()))
        known = self._streams.setdefault(name, _Counted(*ends))
        known.first, known.last = min(known.first, ends[0]), max(known.last, ends[1])
        known.begin_us, known.end_us = min(known.begin_us, ends[2]), max(known.end_us, ends[3])
        known.rows += batch.num_rows
        known.sum += int(sums.of_numbers(mine, same).sum(dtype=np.uint64))

    def parts(self, location: str, table: str) -> list[Part]:
        """What was counted."""
        return [
            Part(
                location,
                table,
                each.rows,
                sums.told(each.sum),
                each.begin_us,
                each.end_us,
                Stream(*name, each.first, each.last),
            )
            for name, each in self._streams.items()
        ]


def tallied(rows: pa.Table, location: str, table: str) -> Part:
    """Of a batch's rows of another table."""
    extent = pc.min_max(rows["utc"].cast(pa.int64())).as_py()
    total = int(sums.of_rows(rows).sum(dtype=np.uint64))
    return Part(location, table, rows.num_rows, sums.told(total), extent["min"], extent["max"])
