"""A table's files as its log knows them, and as a dataset that leaves out those that a query does not need.

The table format's library does the latter too, but takes milliseconds of CPU a file, and reads by way of
Python (see files.py).
"""

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final
from urllib.parse import unquote

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset
from deltalake import DeltaTable
from pyarrow.fs import FileSystem

_OF_THE_LOG: Final = {
    "path": "path",
    "rows": "num_records",
    "size_bytes": "size_bytes",
    "robot": "partition.robot",
    "session": "partition.session",
    "first": "min.utc",
    "last": "max.utc",
    "first_ns": "min.stamp_ns",
    "last_ns": "max.stamp_ns",
}
_EXTENT: Final = ("first", "last", "first_ns", "last_ns")
_ROUNDED_OFF: Final = timedelta(milliseconds=1)  # of a time in the log
_FORMAT: Final = pyarrow.dataset.ParquetFileFormat(
    default_fragment_scan_options=pyarrow.dataset.ParquetFragmentScanOptions(pre_buffer=True)
)
_ALL: Final = pyarrow.dataset.scalar(True)
_column = pyarrow.dataset.field


@dataclass(frozen=True, slots=True)
class DataFile:
    """A file of a table; `path` is below the table's location.

    `robot` and `session` are its partition; all rows are from `first` to before `last`, which the log rounds
    to milliseconds, and their `stamp_ns` from `first_ns` to `last_ns`. None where not known.
    """

    location: str
    path: str
    rows: int
    size_bytes: int
    robot: str | None
    session: str | None
    first: datetime | None
    last: datetime | None
    first_ns: int | None
    last_ns: int | None


@dataclass(frozen=True, slots=True)
class Extent:
    """Joint extent of some files."""

    files: Sequence[DataFile]

    @property
    def first(self) -> datetime | None:
        return min((file.first for file in self.files if file.first), default=None)

    @property
    def last(self) -> datetime | None:
        return max((file.last for file in self.files if file.last), default=None)

    @property
    def rows(self) -> int:
        return sum(file.rows for file in self.files)

    @property
    def size_bytes(self) -> int:
        return sum(file.size_bytes for file in self.files)


def data_files(delta: DeltaTable, location: str) -> Iterator[DataFile]:
    """Yield every file of this version, from the log alone."""
    log = _log(delta)
    for path, *values in zip(*(log[name].to_pylist() for name in _OF_THE_LOG), strict=True):
        yield DataFile(location, unquote(path), *values)


def as_dataset(delta: DeltaTable, location: str, files: FileSystem) -> pyarrow.dataset.Dataset:
    """Return the rows of this version; `files` are the store's."""
    log = _log(delta)
    names = (log[name].to_pylist() for name in ("path", "robot", "session"))
    fragments = [
        _FORMAT.make_fragment(
            f"{location}/{unquote(path)}",
            files,
            _partition(robot, session) & _between("utc", first, last) & _between("stamp_ns", *stamps),
        )
        for path, robot, session, first, last, *stamps in zip(
            *names, *(log[name] for name in _EXTENT), strict=True
        )
    ]
    return pyarrow.dataset.FileSystemDataset(fragments, pa.schema(delta.schema().to_arrow()), _FORMAT, files)


def _log(delta: DeltaTable) -> dict[str, pa.ChunkedArray]:
    """Return the log's columns on files, under our names."""
    log = pa.table(delta.get_add_actions(flatten=True))
    found = {
        ours: log[theirs] if theirs in log.column_names else pa.chunked_array([pa.nulls(log.num_rows)])
        for ours, theirs in _OF_THE_LOG.items()
    }
    if pa.types.is_timestamp(found["last"].type):
        found["last"] = pc.add(found["last"], pa.scalar(_ROUNDED_OFF))
    return found


def _between(name: str, first: pa.Scalar, last: pa.Scalar) -> pyarrow.dataset.Expression:
    """Return it as Arrow has the times: made of Python's, an expression takes half a millisecond."""
    if not (first.is_valid and last.is_valid):
        return _ALL
    return (_column(name) >= first) & (_column(name) <= last)


@functools.lru_cache(1_000)
def _partition(robot: str | None, session: str | None) -> pyarrow.dataset.Expression:
    """Return the condition that all rows of a partition fulfil, and no others."""
    known = _ALL
    if robot is not None:
        known = known & (_column("robot") == robot)
    return known if session is None else known & (_column("session") == session)
