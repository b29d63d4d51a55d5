"""Curves straight into pixels: for each column of the plot the span of rows that a curve covers.

As thin and as sharp as Qt's own lines without antialiasing, for a fraction of their time: what a curve costs
depends on the pixels that it covers, not on its points. No spike is lost, however many points a column has.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.uint32]
Places = npt.NDArray[np.intp]
SAMPLES_A_COLUMN: Final = 2  # where there are fewer points, the line between them is sampled so often
DASH: Final = 5  # columns on, columns off


@dataclass(frozen=True, slots=True)
class View:
    """What part of the plane the picture shows, and its size in pixels."""

    left: float
    right: float
    low: float
    high: float
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class Columns:
    """Which points fall into which columns; the same for all curves of one time axis."""

    times: Floats  # of the samples
    starts: Places  # the first sample of each column that has one
    places: Places  # the column's number
    sampled: bool  # the samples lie between the points, not on them

    @classmethod
    def of(cls, times: Floats, view: View) -> "Columns":
        """The columns of these times, which rise."""
        scale = view.width / (view.right - view.left)
        sampled = len(times) < SAMPLES_A_COLUMN * view.width
        if sampled and len(times):
            first, last = max(times[0], view.left), min(times[-1], view.right)
            count = max(2, round((last - first) * scale * SAMPLES_A_COLUMN))
            times = np.linspace(first, last, count)
        places = np.clip(((times - view.left) * scale).astype(np.intp), 0, view.width - 1)
        starts = np.flatnonzero(np.diff(places, prepend=-1))
        return cls(times, starts, places[starts], sampled)


def draw(
    pixels: Pixels, view: View, times: Floats, curves: Sequence[Floats], inks: Sequence[tuple[int, bool]]
) -> None:
    """Draw curves over their times; an ink is a colour (0xAARRGGBB) and whether the line is dashed."""
    if len(times) < 2 or view.high <= view.low:
        return
    columns = Columns.of(times, view)
    for values, (colour, dashed) in zip(curves, inks, strict=True):
        samples = np.interp(columns.times, times, values) if columns.sampled else values
        places, top, bottom = spans(samples, columns, view)
        if dashed:
            seen = places // DASH % 2 == 0
            places, top, bottom = places[seen], top[seen], bottom[seen]
        fill(pixels, places, top, bottom, colour)


def spans(samples: Floats, columns: Columns, view: View) -> tuple[Places, Places, Places]:
    """Columns in which the curve is in sight; the first and last row that it covers there, from the top."""
    low = np.fmin.reduceat(samples, columns.starts)
    high = np.fmax.reduceat(samples, columns.starts)
    before = samples[columns.starts - 1]  # the line comes from the last sample of the column before
    before[0] = np.nan
    joined = ~np.isnan(low)
    low, high = np.fmin(low, before), np.fmax(high, before)
    seen = joined & (high >= view.low) & (low <= view.high)
    scale = (view.height - 1) / (view.high - view.low)
    top = np.clip((view.high - high[seen]) * scale + 0.5, 0, view.height - 1).astype(np.intp)
    bottom = np.clip((view.high - low[seen]) * scale + 0.5, 0, view.height - 1).astype(np.intp)
    return columns.places[seen], top, bottom


def fill(pixels: Pixels, places: Places, top: Places, bottom: Places, colour: int) -> None:
    """Colour the rows from `top` to `bottom` in each of these columns."""
    counts = bottom - top + 1
    ends = np.cumsum(counts)
    if not len(ends):
        return
    rows = np.arange(ends[-1]) - np.repeat(ends - counts - top, counts)
    pixels[rows, np.repeat(places, counts)] = colour
