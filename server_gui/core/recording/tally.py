"""Counts and sums of what a batch has in a table, for its receipt."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import msgspec
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from ml.store import checksums
from ml.store.tables import UTC
from server_gui.core.recording.missing_rows import numbers_alone
from server_gui.core.recording.receipts import Mark, ReceiptPart, Stream

Units = Mapping[str, str | None]
NAMING: Final = ("seq", "row")  # what names a row of telemetry among those of its stream
NUMBER: Final = ("number",)  # a row of another table among those of its batch
# What marks may be apart, finest first: `gwrms cloud retain` removes whole minutes, programs what they like.
_WIDTHS_US: Final = (50_000, 200_000, 1_000_000, 5_000_000, 20_000_000, 60_000_000)
_MOST: Final = 4  # marks of a part, where they are less than a minute apart
_Name = tuple[str, str, str, int]  # robot, session, connection, stream


def named(batch: pa.RecordBatch, naming: Sequence[str]) -> checksums.Sums:
    """Return a number a row of what names it, whatever type somebody may have given that."""
    columns = [batch[name].cast(pa.int64()) for name in naming]
    return checksums.of_numbers(pa.record_batch(columns, names=list(naming)), {})


def times_us(column: pa.Array | pa.ChunkedArray) -> npt.NDArray[np.int64]:
    """In µs since 1970; where there is none, long before."""
    whole = column.cast(UTC).cast(pa.int64()).fill_null(np.iinfo(np.int64).min)
    return np.asarray(whole, np.int64)


@dataclass(slots=True)
class _Times:
    """Counts and sums of rows, in each of the finest widths."""

    _found: dict[int, tuple[int, int]] = field(default_factory=dict)

    def add(self, times: npt.NDArray[np.int64], each: checksums.Sums) -> None:
        places, which = np.unique(times // _WIDTHS_US[0], return_inverse=True)
        totals = np.zeros(len(places), np.uint64)
        np.add.at(totals, which, each)
        for place, rows, total in zip(
            places.tolist(), np.bincount(which).tolist(), totals.tolist(), strict=True
        ):
            known = self._found.get(place, (0, 0))
            self._found[place] = (known[0] + rows, known[1] + total)

    def marks(self) -> tuple[Mark, ...]:
        """As fine as few marks are, else a minute apart; none before the first row."""
        widths = [width // _WIDTHS_US[0] for width in _WIDTHS_US]
        counts = (len({place // width for place in self._found}) - 1 for width in widths)
        width = next((w for w, count in zip(widths, counts, strict=True) if count <= _MOST), widths[-1])
        marks: list[Mark] = []
        rows = total = 0
        begins = sorted(self._found, reverse=True)
        for place, before in itertools.pairwise(begins):
            rows, total = rows + self._found[place][0], total + self._found[place][1]
            if before // width < place // width:
                marks.append(Mark(place // width * width * _WIDTHS_US[0], rows, checksums.told(total)))
        return tuple(reversed(marks))


@dataclass(slots=True)
class _Counted:
    first: int
    last: int
    begin_us: int
    end_us: int
    rows: int = 0
    sum: int = 0
    names: int = 0
    times: _Times = field(default_factory=_Times)


@dataclass(slots=True)
class Tally:
    """Tally of runs of telemetry, a stream at a time."""

    _streams: dict[_Name, _Counted] = field(default_factory=dict)

    def clear(self) -> None:
        """Begin anew."""
        self._streams.clear()

    def add(self, batch: pa.RecordBatch) -> None:
        """Count a run."""
        mine, same = numbers_alone(batch)
        seqs = batch["seq"].to_numpy()
        times = times_us(batch["utc"])
        name = (same["robot"], same["session"], same["connection"], batch["stream"][0].as_py())
        ends = (int(seqs[0]), int(seqs[-1]), int(times.min()), int(times.max()))
        known = self._streams.setdefault(name, _Counted(*ends))
        known.first, known.last = min(known.first, ends[0]), max(known.last, ends[1])
        known.begin_us, known.end_us = min(known.begin_us, ends[2]), max(known.end_us, ends[3])
        each = checksums.of_numbers(mine, same)
        known.rows += batch.num_rows
        known.sum += int(each.sum(dtype=np.uint64))
        known.names += int(named(batch, NAMING).sum(dtype=np.uint64))
        known.times.add(times, each)

    def parts(self, location: str, table: str, units: Units) -> list[ReceiptPart]:
        """Return the counts, the first with the units of the columns."""
        found = [
            ReceiptPart(
                location,
                table,
                each.rows,
                checksums.told(each.sum),
                each.begin_us,
                each.end_us,
                Stream(*name, each.first, each.last),
                checksums.told(each.names),
                each.times.marks(),
            )
            for name, each in self._streams.items()
        ]
        return [msgspec.structs.replace(each, units=dict(units)) for each in found[:1]] + found[1:]


def tallied(rows: pa.Table, location: str, table: str, units: Units) -> ReceiptPart:
    """Count a batch's rows of another table."""
    extent = pc.min_max(rows["utc"].cast(pa.int64())).as_py()
    each, timed, times = checksums.of_rows(rows), rows["utc"].is_valid().to_numpy(), _Times()
    times.add(times_us(rows["utc"])[timed], each[timed])
    numbers = sum(int(named(batch, NUMBER).sum(dtype=np.uint64)) for batch in rows.to_batches())
    return ReceiptPart(
        location,
        table,
        rows.num_rows,
        checksums.told(int(each.sum(dtype=np.uint64))),
        extent["min"],
        extent["max"],
        names=checksums.told(numbers),
        marks=times.marks(),
        units=dict(units),
    )
