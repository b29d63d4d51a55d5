"""A curve as text: Unicode's braille letters are a grid of two by four dots each."""

import math
from collections.abc import Iterator, Sequence
from typing import Final

BLANK: Final = 0x2800
# The bit of each dot, by row and column of a letter (Unicode 15.0, "Braille Patterns").
DOTS: Final = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
LARGEST: Final = 1e300  # numbers beyond cannot be counted with
Sample = tuple[float, float | None]  # when, s; and the value


def draw(
    samples: Sequence[Sample], begin_s: float, end_s: float, low: float, high: float, size: tuple[int, int]
) -> list[str]:
    """Return lines of letters, `size` columns and rows.

    A gap in time leaves a hole, and so does a value that is missing, no number, or too large to be drawn.
    """
    columns, rows = size
    width, height = 2 * columns, 4 * rows
    cells = [[BLANK] * columns for _ in range(rows)]
    for x, y in _dots(samples, begin_s, end_s, low, high, (width, height)):
        row = height - 1 - y
        cells[row // 4][x // 2] |= DOTS[row % 4][x % 2]
    return ["".join(map(chr, line)) for line in cells]


def _dots(
    samples: Sequence[Sample], begin_s: float, end_s: float, low: float, high: float, size: tuple[int, int]
) -> Iterator[tuple[int, int]]:
    """Yield the dots of the curve, joined up and down between two columns that follow each other."""
    width, height = size
    before: tuple[int, int] | None = None
    for time_s, value in samples:
        if value is None or not abs(value) < LARGEST:
            before = None
            continue
        x = round((time_s - begin_s) / (end_s - begin_s) * (width - 1))
        y = round((min(max(value, low), high) - low) / (high - low) * (height - 1))
        if not 0 <= x < width:
            continue
        near = before is not None and x - before[0] <= 1
        first = before[1] if before is not None and near else y
        yield from ((x, between) for between in range(first + 1, y))  # what the step from there passes over
        yield from ((x, between) for between in range(y + 1, first))
        yield x, y
        before = x, y


def extent(samples: Sequence[Sample]) -> tuple[float, float]:
    """Return round ends of what is drawn; never nothing, so that a value that stands still is a line."""
    found = [value for _, value in samples if value is not None and abs(value) < LARGEST]
    low, high = min(found, default=0.0), max(found, default=0.0)
    span = max(high - low, 1e-3, 1e-3 * max(abs(low), abs(high)))
    step = 10.0 ** math.floor(math.log10(span))
    return math.floor(low / step) * step, math.ceil((high + 1e-9 * step) / step) * step
