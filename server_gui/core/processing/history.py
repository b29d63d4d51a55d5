"""The past of some numbers in two bounded rings: every look of the last minutes, then a row a minute."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
FINE_ROWS, COARSE_ROWS = 600, 480  # ten minutes at a look a second; eight hours
COARSE_S: Final = 60.0


class Ring:
    """The newest rows of so many numbers, each with its time (s)."""

    def __init__(self, rows: int, columns: int) -> None:
        self._data = np.full((rows, 1 + columns), np.nan)
        self._next = 0
        self._count = 0

    def append(self, time_s: float, values: Sequence[float | None]) -> None:
        """Add a row, None where a number is not known; the oldest goes."""
        row = self._data[self._next]
        row[0] = time_s
        row[1:] = [np.nan if value is None else value for value in values]
        self._next = (self._next + 1) % len(self._data)
        self._count = min(self._count + 1, len(self._data))

    def rows(self) -> Floats:
        """Return rows in order, oldest first: time and numbers, NaN where one is not known. A copy."""
        if self._count < len(self._data):
            return self._data[: self._count].copy()
        return np.roll(self._data, -self._next, axis=0)


class History:
    """Numbers over time: `recent` is every row of the last minutes, `hours` the means of each minute."""

    def __init__(self, columns: Sequence[str]) -> None:
        self.columns = tuple(columns)
        self._fine = Ring(FINE_ROWS, len(columns))
        self._coarse = Ring(COARSE_ROWS, len(columns))
        self._minute: list[Sequence[float | None]] = []
        self._minute_s = 0.0

    def append(self, time_s: float, values: Sequence[float | None]) -> None:
        """Add a row."""
        self._fine.append(time_s, values)
        if self._minute and time_s - self._minute_s >= COARSE_S:
            self._coarse.append(self._minute_s, [_mean(column) for column in zip(*self._minute, strict=True)])
            self._minute.clear()
        if not self._minute:
            self._minute_s = time_s
        self._minute.append(tuple(values))

    def recent(self) -> Floats:
        """(rows, 1 + columns): time in s and the numbers, NaN where one is not known."""
        return self._fine.rows()

    def hours(self) -> Floats:
        """Return the same, a row for each whole minute of the last hours."""
        return self._coarse.rows()


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None
