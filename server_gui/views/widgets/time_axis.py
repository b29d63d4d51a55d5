"""The axis of time below a plot: seconds until now, each with its unit."""

from collections.abc import Sequence
from typing import Final

import pyqtgraph as pg
from PySide6.QtCore import QRectF

from gateway.units import with_minus

STEPS_S: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0)
NOW: Final = "now"
LAST: Final = "last"
PAUSED: Final = "paused"
SHOWN: Final = "shown"


class TimeAxis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    """Its last place is now; or the last that came, when it was paused, what is shown of a recording."""

    def __init__(self) -> None:
        self._label_px = 50
        self._end = NOW
        self._since_s: float | None = None
        super().__init__("bottom")
        self.setStyle(hideOverlappingLabels=False)  # else those at its ends are left out

    def set_label_room(self, pixels: int) -> None:
        """Set how wide a place is, with the space around it."""
        self._label_px = pixels
        self.picture = None
        self.update()

    def set_end(self, word: str, since_s: float | None = None) -> bool:
        """Set what its last place is called: `NOW`, `LAST`, `PAUSED` or `SHOWN`; return whether it is new.

        With `since_s`, how long after the beginning of a recording it is, every place is called so.
        """
        is_new = (word, since_s) != (self._end, self._since_s)
        if is_new:
            self._end, self._since_s = word, since_s
            self.picture = None
            self.update()
        return is_new

    def boundingRect(self) -> QRectF:
        """With room for the words at its ends."""
        box = QRectF(super().boundingRect())
        return box.adjusted(-self._label_px, 0, self._label_px, 0)

    def tickSpacing(self, low: float, high: float, size: float) -> list[tuple[float, float]]:
        """Return how far places are apart: as near as there is room for what stands there."""
        least = (high - low) * self._label_px / max(size, 1.0)
        step = next((step for step in STEPS_S if step >= least), STEPS_S[-1])
        return [(step, 0.0 if self._since_s is None else -self._since_s % step)]

    def tickStrings(self, values: Sequence[float], scale: float, spacing: float) -> list[str]:
        """Return the labels of these places."""
        since_s = self._since_s
        if since_s is not None:
            return [session_text(since_s + value, spacing) for value in values]
        said = [time_text(value) for value in values]
        return [self._end if text == NOW else text for text in said]


def session_text(seconds: float, step_s: float) -> str:
    """Return a time since the beginning of a recording, m:ss, as fine as places are apart."""
    digits = 0 if step_s >= 1.0 else 1 if step_s >= 0.1 else 2
    minutes, rest = divmod(round(max(seconds, 0.0), digits), 60)
    return f"{int(minutes)}:{rest:0{3 + digits if digits else 2}.{digits}f}"


def time_text(seconds: float) -> str:
    """Return a time until the newest row in words."""
    return NOW if abs(seconds) < 1e-9 else with_minus(f"{seconds:.6g} s")
