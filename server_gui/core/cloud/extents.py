"""Check of the times that log and file claim for a file's rows: queries by time skip other files."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any, Final

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from ml.store.fragments import DataFile

COLUMNS: Final = ("utc", "stamp_ns")
_ROUNDED: Final = timedelta(milliseconds=1)  # what a time in the log may be off by
_Extent = tuple[Any, Any]  # the first and the last; None where there is none


@dataclass(slots=True)
class RowExtents:
    """From when to when rows are that were read."""

    _found: dict[str, _Extent] = field(default_factory=dict)

    def add(self, batch: pa.RecordBatch) -> None:
        """Add these."""
        for name in COLUMNS:
            if name in batch.schema.names:
                extent = pc.min_max(batch[name])
                ends = _utc(extent["min"].as_py()), _utc(extent["max"].as_py())
                self._found[name] = _both(self._found.get(name, (None, None)), ends)

    def differing(self, metadata: pq.FileMetaData) -> Iterator[str]:
        """In words, where the file's own statistics say something else."""
        told = _of_footer(metadata)
        for name, ends in self._found.items():
            if told.get(name, ends) != ends:
                yield _words(name, told[name], ends, "its own statistics say")


def differing(file: DataFile, metadata: pq.FileMetaData) -> Iterator[str]:
    """In words, where the table's log says something else than the file's own statistics."""
    times = (file.first, file.last), _ROUNDED
    stamps = (file.first_ns, file.last_ns), 0
    found = _of_footer(metadata)
    for name, (told, slack) in zip(COLUMNS, (times, stamps), strict=True):
        ends = found.get(name, (None, None))
        if None not in (*told, *ends) and not _fits(told, ends, slack):
            yield _words(name, told, ends, "the table's log says")


def _fits(told: _Extent, ends: _Extent, slack: Any) -> bool:
    """Return whether rows from one end to the other are within what was told, which is hardly more."""
    return bool(told[0] <= ends[0] <= told[0] + slack and told[1] - slack <= ends[1] <= told[1])


def _words(name: str, told: _Extent, ends: _Extent, who: str) -> str:
    return (
        f"{who} that {name} goes from {told[0]} to {told[1]}, and it goes from {ends[0]} to {ends[1]}: "
        "a query for a time may not find its rows; bring log and file back from a copy"
    )


def _of_footer(metadata: pq.FileMetaData) -> dict[str, _Extent]:
    """Return it as its row groups have it together; without what one of them does not tell."""
    places = {metadata.schema.column(place).path: place for place in range(metadata.num_columns)}
    found: dict[str, _Extent] = {}
    for name in places.keys() & set(COLUMNS):
        groups = [metadata.row_group(each).column(places[name]) for each in range(metadata.num_row_groups)]
        told = [each.statistics for each in groups if each.statistics is not None]
        if groups and len(told) == len(groups) and all(each.has_min_max for each in told):
            found[name] = (_utc(min(each.min for each in told)), _utc(max(each.max for each in told)))
    return found


def _utc(value: Any) -> Any:
    return value.replace(tzinfo=UTC) if isinstance(value, datetime) and value.tzinfo is None else value


def _both(one: _Extent, other: _Extent) -> _Extent:
    firsts, lasts = zip(one, other, strict=True)
    return (
        min((each for each in firsts if each is not None), default=None),
        max((each for each in lasts if each is not None), default=None),
    )
