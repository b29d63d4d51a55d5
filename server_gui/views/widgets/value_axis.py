"""The axis of values beside a plot: its places are as far apart as what stands there is high."""

import math
from collections.abc import Sequence
from typing import Final

import pyqtgraph as pg

from gateway.units import with_minus

STEPS: Final = (1.0, 2.0, 2.5, 5.0, 10.0)
CLOSE: Final = 0.8  # of the room for a place, where else only one had it: that tells no scale
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
        """Return those places: none so low that what stands there is on the words of the axis below."""
        least = low + abs(high - low) * self._label_px / (4 * max(size, 1.0))
        found = super().tickValues(low, high, size)
        return [(step, [value for value in values if value >= least]) for step, values in found]

    def tickStrings(self, values: Sequence[float], scale: float, spacing: float) -> list[str]:
        """Return the labels of these places."""
        near = [0.0 if abs(value) < spacing / 1000 else value * scale for value in values]
        return [with_minus(f"{value:.6g}") for value in near]
