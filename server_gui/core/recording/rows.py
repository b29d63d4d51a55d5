"""Contents of the spool: runs of telemetry rows, and records of every other table."""

from dataclasses import dataclass
from typing import Any, Final

import msgspec
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
STAMP: Final = np.dtype("<i8")
VALUE: Final = np.dtype("<f8")
KEYS: Final = 4  # columns before the values
AT_ONCE: Final = 256  # rows that are turned while they are in the processor's cache


class Layout(msgspec.Struct, frozen=True):
    """The columns of a run, in order: channel names, and their units as the robot describes them."""

    channels: tuple[str, ...]
    units: tuple[str | None, ...]  # None: the robot has not described this channel


@dataclass(frozen=True, slots=True)
class Run:
    """Consecutive rows of one stream with the same columns.

    `stamps_ns` are on the robot's monotonic clock; add `utc_offset_ns` to come to UTC. A row is named by its
    robot, connection, stream, `seqs[i]` (its notification) and `rows[i]` (its place in that). `values` has
    one row a channel; NaN stands for null, which nothing else can: the wire has no NaN.
    """

    robot: str
    session: str
    connection: str
    stream: int
    layout: Layout
    stamps_ns: Ints
    seqs: Ints
    rows: Ints
    utc_offset_ns: Ints
    values: Floats  # channels × rows

    def __len__(self) -> int:
        return len(self.stamps_ns)


class Record(msgspec.Struct, frozen=True):
    """One row of a table that is not telemetry; `fields` are that table's own columns."""

    table: str
    fields: dict[str, Any]


class JournalHead(msgspec.Struct, frozen=True):
    """The newest entry of a robot's journal that has been recorded: its number and hash."""

    n: int
    hash: str


def pack(run: Run) -> bytes:
    """Row after row of little-endian 8-byte numbers, so that packed runs can simply be put together."""
    rows = np.empty((len(run), KEYS + len(run.values)), VALUE)
    keys = rows.view(STAMP)
    for place, key in enumerate((run.stamps_ns, run.seqs, run.rows, run.utc_offset_ns)):
        keys[:, place] = key
    rows[:, KEYS:] = run.values.T
    return rows.tobytes()


def unpack(robot: str, session: str, connection: str, stream: int, layout: Layout, data: bytes) -> Run:
    """Return the run that was packed, or several with the same name."""
    width = KEYS + len(layout.channels)
    rows = np.frombuffer(data, VALUE).reshape(-1, width)
    columns = np.empty((width, len(rows)), VALUE)
    for begin in range(0, len(rows), AT_ONCE):
        columns[:, begin : begin + AT_ONCE] = rows[begin : begin + AT_ONCE].T
    keys = columns[:KEYS].view(STAMP)
    return Run(robot, session, connection, stream, layout, keys[0], keys[1], keys[2], keys[3], columns[KEYS:])
