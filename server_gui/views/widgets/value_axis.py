"""The axis of values beside a plot: its places are as far apart as what stands there is high."""

import math
from collections.abc import Sequence
from typing import Final

import pyqtgraph as pg

from gateway.units import with_minus

STEPS: Final = (1.0, 2.0, 2.5, 5.0, 10.0)
CLOSE: Final = 0.8  # of the room for a place, where else only one had it: that tells no scale
FINER: Final = 3  # smaller steps that are tried where only one place had room
MOST: Final = 6  # numbers, about, however high the plot is


class ValueAxis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    """Its numbers stand never on each other, however low the plot is."""

    def __init__(self) -> None:
        self._label_px = 20
        super().__init__("left")

    def set_label_room(self, pixels: int) -> None:
        """Set how high a place is, with the space around it."""
        self._label_px = pixels
        self.picture = None
        self.update()

    def tickSpacing(self, low: float, high: float, size: float) -> list[tuple[float, float]]:
        """Return how far places are apart: 1, 2, 2.5 or 5 of a decade, as near as there is room for."""
        for share in (1.0, CLOSE):
            least = abs(high - low) * max(share * self._label_px / max(size, 1.0), 1.0 / MOST)
            if not 0.0 < least < math.inf:
                return []
            decade = 10.0 ** math.floor(math.log10(least))
            step = next(step * decade for step in STEPS if step * decade >= least * (1 - 1e-9))
            if math.floor(high / step) > math.ceil(low / step):
                break
        return [(step, 0.0)]

    def tickValues(self, low: float, high: float, size: float) -> list[tuple[float, list[float]]]:
        """Return those places: none so low that what stands there is on the words of the axis below.

        In a low plot some between them are left out, so that two others have room: one tells no scale.
        """
        a_label = abs(high - low) * self._label_px / max(size, 1.0)
        begin = low + a_label / 4
        for coarse, _ in self.tickSpacing(low, high, size):
            steps = [coarse, *_finer(coarse)]
            tried = [
                (step, thinned(_places(begin, high, step), gap))
                for gap in (a_label, CLOSE * a_label)
                for step in steps
            ]
            return [next((one for one in tried if len(one[1]) > 1), tried[0])]
        return []

    def tickStrings(self, values: Sequence[float], scale: float, spacing: float) -> list[str]:
        """Return the labels of these places."""
        near = [0.0 if abs(value) < spacing / 1000 else value * scale for value in values]
        return [with_minus(f"{value:.6g}") for value in near]


def thinned(values: Sequence[float], gap: float) -> list[float]:
    """Return the highest of these and, downwards, each that is so far below the one before."""
    kept: list[float] = []
    for value in reversed(values):
        if not kept or kept[-1] - value >= gap * (1 - 1e-9):
            kept.append(value)
    return kept[::-1]


def _places(begin: float, end: float, step: float) -> list[float]:
    """Return the multiples of a step between these."""
    return [number * step for number in range(math.ceil(begin / step), math.floor(end / step) + 1)]


def _finer(step: float) -> list[float]:
    """Return the next smaller steps, the largest first."""
    decade = 10.0 ** math.floor(math.log10(step) + 1e-9)
    known = {share * one for share in STEPS for one in (decade, decade / 10)}
    return sorted((one for one in known if one < step * (1 - 1e-9)), reverse=True)[:FINER]
