"""Curves straight into pixels: for each column of the plot the span of rows that a curve covers.

As thin and as sharp as Qt's own lines without antialiasing, for a fraction of their time. A column of time
keeps its column of pixels for good, as on a strip chart: only what is new is drawn. What a frame costs thus
depends on the pixels that have come, not on the points that there are. No spike is lost.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.uint32]
Places = npt.NDArray[np.int64]
SAMPLES_A_COLUMN: Final = 2  # where there are fewer points, the line between them is sampled so often


@dataclass(frozen=True, slots=True)
class View:
    """Section in the picture: `seconds` until the newest row, values from `low` to `high`; its pixels."""

    seconds: float
    low: float
    high: float
    width: int
    height: int

    @property
    def scale(self) -> float:
        """Columns a second."""
        return self.width / self.seconds


@dataclass(frozen=True, slots=True)
class Inks:
    """A colour (0xAARRGGBB) a curve, which are thin (then others are bold), and what is behind them."""

    colours: tuple[int, ...] = ()
    thin: tuple[bool, ...] = ()
    behind: int = 0


class Strip:
    """The picture of the curves of one plot; column `c` of time is at `c` modulo the width."""

    def __init__(self) -> None:
        self.pixels: Pixels = np.zeros((1, 1), np.uint32)
        self.last = 0  # the newest column of time that was drawn
        self._key: tuple[object, ...] = ()
        self._newest_s = 0.0

    @property
    def seam(self) -> int:
        """The column of pixels that holds the oldest: the picture goes from here around to here."""
        return (self.last + 1) % len(self.pixels[0])

    def draw(self, source: object, view: View, times: Floats, curves: Sequence[Floats], inks: Inks) -> bool:
        """Draw curves over their times (s, rising); whether the picture has become another.

        Rows of the same `source` are only ever added: what was drawn of it is not drawn again.
        """
        sampled = len(times) < SAMPLES_A_COLUMN * view.width
        key = (source, view, inks, sampled, len(curves))
        newest_s = float(times[-1]) if len(times) else 0.0
        if key == self._key and newest_s == self._newest_s:
            return False
        newest = math.floor(newest_s * view.scale)
        first = newest - view.width + 1
        if key == self._key and first <= self.last <= newest:
            first = self.last
        else:
            self._begin(key, view, inks)
        self.last, self._newest_s = newest, newest_s
        self.pixels[:, np.arange(first, newest + 1) % view.width] = inks.behind
        if len(times) >= 2 and curves and view.high > view.low:
            self._draw_from(first, view, times, curves, inks, sampled=sampled)
        return True

    def forget(self) -> None:
        """Draw everything the next time."""
        self._key = ()

    def _begin(self, key: tuple[object, ...], view: View, inks: Inks) -> None:
        self._key = key
        if self.pixels.shape != (view.height, view.width):
            self.pixels = np.empty((view.height, view.width), np.uint32)
        self.pixels[:] = inks.behind

    def _draw_from(
        self, first: int, view: View, times: Floats, curves: Sequence[Floats], inks: Inks, *, sampled: bool
    ) -> None:
        """Draw the columns from `first` on; the two before them join them to what is there.

        A bold curve covers what the column before covers, and that begins where the one before it ended.
        """
        row = max(0, int(np.searchsorted(times, (first - 2) / view.scale)) - 1)
        times, values = times[row:], np.array([curve[row:] for curve in curves])
        if sampled:
            times, values = samples(times, values, view.scale, begins=row == 0)
        columns = np.floor(times * view.scale).astype(np.int64)
        starts = np.flatnonzero(np.diff(columns, prepend=columns[0] - 1))
        low, high = np.fmin.reduceat(values, starts, axis=1), np.fmax.reduceat(values, starts, axis=1)
        before = values[:, starts - 1]  # the line comes from the last sample of the column before
        before[:, 0] = np.nan
        before[np.isnan(values[:, starts])] = np.nan  # it ended there
        unknown = np.isnan(low)
        low, high = np.fmin(low, before), np.fmax(high, before)
        bold = _bold(inks, len(curves))
        _widen(low, high, columns[starts], bold)
        seen = ~unknown & (high >= view.low) & (low <= view.high) & (columns[starts] >= first)
        curve, column = np.nonzero(seen)
        top, bottom = _rows(high[seen], view), _rows(low[seen], view)
        bottom = np.minimum(bottom + bold[curve], view.height - 1)
        ink = np.array(inks.colours, np.uint32)[curve]
        fill(self.pixels, columns[starts][column] % view.width, top, bottom, ink)


def _bold(inks: Inks, count: int) -> npt.NDArray[np.bool_]:
    """Return which curves are two pixels thick: those beside thin ones, which are one."""
    return ~np.array(inks.thin, np.bool_) if any(inks.thin) else np.zeros(count, np.bool_)


def _widen(low: Floats, high: Floats, columns: Places, bold: npt.NDArray[np.bool_]) -> None:
    """Let each column of a bold curve cover what the one before it covers."""
    if not bold.any():
        return
    joined = np.diff(columns) == 1
    for edge, join in ((low, np.fmin), (high, np.fmax)):
        thick = edge[bold]
        edge[bold, 1:] = np.where(joined, join(thick[:, 1:], thick[:, :-1]), thick[:, 1:])


def samples(times: Floats, values: Floats, scale: float, *, begins: bool) -> tuple[Floats, Floats]:
    """Return the lines between the points, at places that are the same whenever they are drawn.

    The last point is one of them, and the first where nothing was before it.
    """
    first, last = times[0], times[-1]
    step = 1 / (SAMPLES_A_COLUMN * scale)
    inner = (np.arange(np.floor(first / step), np.ceil(last / step) + 1) + 0.5) * step
    at = np.concatenate(([first] if begins else [], inner[(inner > first) & (inner < last)], [last]))
    return at, np.array([np.interp(at, times, line) for line in values])


def _rows(values: Floats, view: View) -> Places:
    scale = (view.height - 1) / (view.high - view.low)
    inside = np.clip(values, view.low, view.high)
    return ((view.high - inside) * scale + 0.5).astype(np.int64)


def fill(pixels: Pixels, places: Places, top: Places, bottom: Places, inks: Pixels) -> None:
    """Colour the rows from `top` to `bottom` in each of these columns; what comes later covers."""
    counts = bottom - top + 1
    ends = np.cumsum(counts)
    if not len(ends):
        return
    rows = np.arange(ends[-1]) - np.repeat(ends - counts - top, counts)
    pixels[rows, np.repeat(places, counts)] = np.repeat(inks, counts)
