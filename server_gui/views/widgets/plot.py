"""A plot that is cheap to draw 30 times a second: pyqtgraph's axes, cached, around our own raster."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyqtgraph as pg
from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QPainter
from PySide6.QtWidgets import QGraphicsItem, QWidget

from server_gui.views.theme import Theme
from server_gui.views.widgets import raster

Floats = npt.NDArray[np.float64]
SHRINK_FRAMES: Final = 60  # a range that has become too wide is narrowed only now and then
MARGIN: Final = 0.06
OLD: Final = 0.35  # opacity of what is not live


@dataclass(frozen=True, slots=True)
class Curve:
    """One line: its colour is a name in the palette, or a colour of its own."""

    channel: str
    colour: str
    dashed: bool = False


class Curves(pg.GraphicsObject):  # type: ignore[misc]  # pyqtgraph has no types
    """All lines of one plot as one picture, made anew when data, range or size have changed."""

    def __init__(self) -> None:
        super().__init__()
        self._times: Floats = np.zeros(0)
        self._values: Sequence[Floats] = ()
        self._inks: Sequence[tuple[int, bool]] = ()
        self._image: QImage | None = None
        self._drawn: tuple[raster.View, float] | None = None

    def set_inks(self, inks: Sequence[tuple[int, bool]]) -> None:
        """Colours (0xAARRGGBB), and which lines are dashed."""
        self._inks, self._times, self._values, self._drawn = inks, np.zeros(0), (), None
        self.update()

    def show_data(self, times: Floats, values: Sequence[Floats]) -> None:
        """Draw these from now on."""
        self._times, self._values, self._drawn = times, values, None
        self.update()

    def boundingRect(self) -> QRectF:
        found: QRectF = self.viewRect()
        return found

    def paint(self, painter: QPainter, *_rest: Any) -> None:
        place: QRectF = self.getViewBox().sceneBoundingRect()
        ratio = painter.device().devicePixelRatio()
        (left, right), (low, high) = self.getViewBox().viewRange()
        width, height = max(1, round(place.width() * ratio)), max(1, round(place.height() * ratio))
        view = raster.View(left, right, low, high, width, height)
        if self._drawn != (view, ratio):
            self._drawn = (view, ratio)
            self._image = self._picture(view)
            self._image.setDevicePixelRatio(ratio)
        to_scene, _ = self.sceneTransform().inverted()
        painter.setTransform(to_scene, True)
        if self._image is not None:
            painter.drawImage(place.topLeft(), self._image)

    def _picture(self, view: raster.View) -> QImage:
        pixels = np.zeros((view.height, view.width), np.uint32)
        raster.draw(pixels, view, self._times, self._values, self._inks)
        data = pixels.data
        image = QImage(
            data, view.width, view.height, 4 * view.width, QImage.Format.Format_ARGB32_Premultiplied
        )
        self._pixels = pixels  # the picture does not keep its memory itself
        return image


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
        self._curves: Sequence[Curve] = ()
        self._lines = Curves()
        self._low, self._high, self._frames = 0.0, least, 0
        self.follows = True  # the range follows the data; off once somebody has zoomed
        item = self.getPlotItem()
        item.hideButtons()
        item.setContentsMargins(0, 0, 0, 0)
        item.addItem(self._lines, ignoreBounds=True)
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
        self._curves = tuple(curves)
        self._frames = 0
        self._restyle()

    def draw(self, times: Floats, columns: Sequence[Floats], *, live: bool) -> None:
        """Draw a column a curve over the times; grey where not `live`."""
        ends = [(np.fmin.reduce(values), np.fmax.reduce(values)) for values in columns if len(values)]
        known = [end for end in ends if end[0] <= end[1]]  # not where all are missing
        if self.follows and known:
            self._follow(float(min(low for low, _ in known)), float(max(high for _, high in known)))
        self._lines.setOpacity(1.0 if live else OLD)
        self._lines.show_data(times, columns)

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
        self._lines.set_inks([(_colour(theme, curve.colour).rgba(), curve.dashed) for curve in self._curves])


def _colour(theme: Theme, name: str) -> QColor:
    return QColor(name) if name.startswith("#") else theme.colour(name)
