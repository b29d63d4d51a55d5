"""Curves that are cheap to draw 30 times a second: thin, not antialiased, decimated, with cached axes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import pyqtgraph as pg
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QGraphicsItem, QWidget

from server_gui.views.theme import Theme

Floats = npt.NDArray[np.float64]
SHRINK_FRAMES: Final = 60  # a range that has become too wide is narrowed only now and then
MARGIN: Final = 0.06


@dataclass(frozen=True, slots=True)
class Curve:
    """One line: its colour is a name in the palette, or a colour of its own."""

    channel: str
    colour: str
    dashed: bool = False


class Plot(pg.PlotWidget):  # type: ignore[misc]  # pyqtgraph has no types
    """Time runs from −`seconds` to 0; the other axis follows the data, quickly out and slowly in.

    `least` is the smallest range that is shown, so that noise on a still joint stays noise.
    """

    def __init__(
        self, theme: Theme, seconds: float, least: float = 1.0, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent, enableMenu=False)
        self._theme = theme
        self._least = least
        self._lines: list[pg.PlotCurveItem] = []
        self._curves: Sequence[Curve] = ()
        self._low, self._high, self._frames = 0.0, least, 0
        self.follows = True  # the range follows the data; off once somebody has zoomed
        item = self.getPlotItem()
        item.hideButtons()
        item.setContentsMargins(0, 0, 0, 0)
        item.setClipToView(False)
        item.getViewBox().setDefaultPadding(0.0)
        item.getViewBox().setMouseEnabled(x=False, y=True)
        item.getViewBox().sigRangeChangedManually.connect(self._zoomed)
        for name in ("left", "bottom"):
            item.getAxis(name).setCacheMode(QGraphicsItem.CacheMode.DeviceCoordinateCache)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setFrameShape(pg.QtWidgets.QFrame.Shape.NoFrame)
        self.set_seconds(seconds)
        theme.changed.connect(self._restyle)
        self._restyle()

    def sizeHint(self) -> QSize:
        """As small as a plot may be; layouts give it more."""
        return QSize(200, 80)

    def set_seconds(self, seconds: float) -> None:
        """How much of the past is shown."""
        self.seconds = seconds
        self.setXRange(-seconds, 0.0, padding=0.0)

    def set_curves(self, curves: Sequence[Curve]) -> None:
        """Which lines there are."""
        if list(curves) == list(self._curves):
            return
        for line in self._lines:
            self.removeItem(line)
        self._curves = tuple(curves)
        self._lines = [pg.PlotCurveItem(skipFiniteCheck=True) for _ in curves]
        for line in self._lines:
            self.addItem(line, ignoreBounds=True)
        self._frames = 0
        self._restyle()

    def draw(self, times: Floats, columns: Sequence[Floats], *, live: bool) -> None:
        """Draw a column a curve over the times; grey where not `live`."""
        low, high = np.inf, -np.inf
        for line, values in zip(self._lines, columns, strict=True):
            x, y = decimated(times, values, 2 * max(64, self.width()))
            missing = bool(np.isnan(y).any())
            line.setData(x, y, connect="finite" if missing else "all", skipFiniteCheck=not missing)
            line.setOpacity(1.0 if live else 0.35)
            if len(y) and not (missing and np.isnan(y).all()):
                low, high = min(low, float(np.nanmin(y))), max(high, float(np.nanmax(y)))
        if self.follows and low <= high:
            self._follow(low, high)

    def follow_again(self) -> None:
        """Let the range follow the data again."""
        self.follows, self._frames = True, 0

    def _follow(self, low: float, high: float) -> None:
        self._frames -= 1
        outside = low < self._low or high > self._high
        if not outside and self._frames > 0:
            return
        self._frames = SHRINK_FRAMES
        spare = max(self._least - (high - low), 0.0) / 2 + MARGIN * max(high - low, self._least)
        self._low, self._high = low - spare, high + spare
        self.setYRange(self._low, self._high, padding=0.0)

    def _zoomed(self, _axes: object) -> None:
        self.follows = False

    def _restyle(self) -> None:
        theme = self._theme
        self.setBackground(theme.colour("card"))
        for name, width in (("left", 44), ("bottom", None)):
            axis = self.getPlotItem().getAxis(name)
            axis.setPen(theme.colour("border"))
            axis.setTextPen(theme.colour("dim"))
            axis.setTickFont(theme.text_font(0.85))
            axis.setStyle(tickLength=-4)
            if width is not None:
                axis.setWidth(theme.px(width))
        for line, curve in zip(self._lines, self._curves, strict=True):
            style = Qt.PenStyle.DashLine if curve.dashed else Qt.PenStyle.SolidLine
            line.setPen(pg.mkPen(_colour(theme, curve.colour), width=1, style=style))


def _colour(theme: Theme, name: str) -> QColor:
    return QColor(name) if name.startswith("#") else theme.colour(name)


def decimated(times: Floats, values: Floats, points: int) -> tuple[Floats, Floats]:
    """At most about `points` of them, the smallest and largest of each stretch, so that no spike is lost."""
    count = len(values)
    step = 2 * count // max(points, 2)
    if step < 2:
        return times[:count], values
    whole = count // step * step
    blocks = values[:whole].reshape(-1, step)
    x = np.repeat(times[:whole:step], 2)
    y = np.empty(2 * len(blocks))
    y[0::2], y[1::2] = blocks.min(axis=1), blocks.max(axis=1)
    return x, y
