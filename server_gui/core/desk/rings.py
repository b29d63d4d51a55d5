"""The past of every channel in one bounded ring, contiguous for drawing without a copy."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

ROWS: Final = 10_000  # 100 s at 100 Hz
MORE_CHANNELS: Final = 64  # room is made for so many at a time
GAP_NS: Final = 500_000_000  # rows further apart are not joined by a line


class Rings:
    """The newest `rows` rows: every row is written twice, half a buffer apart, so that any span is one piece.

    A gap in time, and a channel that was missing, are NaN. Memory is bounded: channels × 2 rows. Rows of one
    `source` are only ever added; it is another one after the past was forgotten.
    """

    def __init__(self, rows: int = ROWS) -> None:
        self.rows = rows
        self.clear()

    def clear(self) -> None:
        """Forget everything: the robot's clock has begun anew."""
        self.source = object()
        self.written = 0  # rows of this source, also those that are forgotten by now
        self.newest_ns: int | None = None
        self._values: Floats = np.full((0, 2 * self.rows), np.nan)
        self._times: Floats = np.full(2 * self.rows, np.nan)
        self._places: dict[str, int] = {}
        self._base_ns = 0
        self._next = 0
        self._count = 0

    def take(self, stamps_ns: Sequence[int], columns: Mapping[str, Sequence[float | None]]) -> None:
        """Add the rows of a batch."""
        if not stamps_ns:
            return
        if self.newest_ns is not None and stamps_ns[0] < self.newest_ns:
            self.clear()
        if self.newest_ns is None:
            self._base_ns = stamps_ns[0]
        elif stamps_ns[0] - self.newest_ns > GAP_NS:
            self._write([self.newest_ns + 1], {})
        stamps_ns = stamps_ns[-self.rows :]
        self._write(stamps_ns, {name: column[-self.rows :] for name, column in columns.items()})
        self.newest_ns = stamps_ns[-1]

    def seconds(self, stamp_ns: int) -> float:
        """Return where an instant of the robot's clock is on the axis of `times`."""
        return (stamp_ns - self._base_ns) / 1e9

    def stamp_ns(self, seconds: float) -> int:
        """Return which instant of the robot's clock is there."""
        return self._base_ns + round(seconds * 1e9)

    def times(self, seconds: float) -> Floats:
        """Return times of the rows of the last `seconds`, s since the first row. The ring's own.

        Do not keep it.
        """
        times = self._span(self._times)
        if not len(times):
            return times
        return times[int(np.searchsorted(times, times[-1] - seconds)) :]

    def values(self, channel: str, count: int) -> Floats:
        """Return a channel's newest `count` values, NaN where there is none; not to be kept."""
        place = self._places.get(channel)
        if place is None:
            return np.full(min(count, self._count), np.nan)
        found = self._span(self._values[place])
        return found[len(found) - min(count, len(found)) :]

    def _span(self, buffer: Floats) -> Floats:
        end = self._next + self.rows
        return buffer[end - self._count : end]

    def _write(self, stamps_ns: Sequence[int], columns: Mapping[str, Sequence[float | None]]) -> None:
        self._make_room(columns)
        count = len(stamps_ns)
        self.written += count
        block = np.full((1 + len(self._places), count), np.nan)
        block[0] = (np.array(stamps_ns, np.int64) - self._base_ns) / 1e9
        if columns:
            places = [1 + self._places[name] for name in columns]
            block[places] = np.array(list(columns.values()), np.float64)  # None becomes NaN
        until_end = min(count, self.rows - self._next)
        for at, part in ((self._next, block[:, :until_end]), (0, block[:, until_end:])):
            for half in (at, at + self.rows):
                self._times[half : half + part.shape[1]] = part[0]
                self._values[: len(part) - 1, half : half + part.shape[1]] = part[1:]
        self._next = (self._next + count) % self.rows
        self._count = min(self._count + count, self.rows)

    def _make_room(self, columns: Mapping[str, Sequence[float | None]]) -> None:
        for name in columns:
            self._places.setdefault(name, len(self._places))
        if len(self._places) > len(self._values):
            wider = np.full((len(self._places) + MORE_CHANNELS, 2 * self.rows), np.nan)
            wider[: len(self._values)] = self._values
            self._values = wider
