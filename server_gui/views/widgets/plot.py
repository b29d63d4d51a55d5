"""A plot that is cheap to draw 30 times a second: pyqtgraph's axes, cached, around our own raster."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRect, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QGraphicsItem, QWidget

from server_gui.views.theme import Theme
from server_gui.views.widgets import raster
from server_gui.views.widgets.cursors import Cursors

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


class Curves(QWidget):
    """All lines of one plot as a strip over its field: what is below is not drawn again for them."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.strip = raster.Strip()
        self._image = QImage()
        self._pixels = self.strip.pixels  # that the picture is of: it does not keep its memory itself
        self._behind = QColor()
        self._live = True
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)

    def set_behind(self, colour: QColor) -> None:
        """What is behind the lines, also where nothing was drawn yet."""
        self._behind = colour
        self.update()

    def show_strip(self, drawn: bool, *, live: bool) -> None:
        """Show the strip as it is now; `drawn`: it has become another."""
        if not drawn and live == self._live:
            return
        self._live, self._pixels = live, self.strip.pixels
        height, width = self._pixels.shape
        self._image = QImage(self._pixels.data, width, height, 4 * width, QImage.Format.Format_RGB32)
        self._image.setDevicePixelRatio(self.devicePixelRatioF())
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), self._behind)
        painter.setOpacity(1.0 if self._live else OLD)
        ratio, seam, (height, width) = self.devicePixelRatioF(), self.strip.seam, self._pixels.shape
        for begin, end, at in ((seam, width, 0), (0, seam, width - seam)):
            painter.drawImage(QPointF(at / ratio, 0), self._image, QRect(begin, 0, end - begin, height))
        painter.end()


class Plot(pg.PlotWidget):  # type: ignore[misc]  # pyqtgraph has no types
    """Time runs from −`seconds` to 0; the other axis follows the data, quickly out and slowly in.

    `least` is the smallest range that is shown, so that noise on a still joint stays noise. Where it `zooms`,
    wheel, drag and box choose a part of the time too, while new rows go on coming.
    """

    zoomed = Signal(float, float)  # from, to: s, until the newest row
    moved = Signal(int, float)  # which cursor, where to

    def __init__(self, theme: Theme, seconds: float, least: float = 1.0, *, zooms: bool = False) -> None:
        super().__init__(enableMenu=False)
        self._theme = theme
        self._least = least
        self._curves: Sequence[Curve] = ()
        self._inks = raster.Inks()
        self._low, self._high, self._frames = 0.0, least, 0
        self._followed: tuple[object, float] = (None, 0.0)  # whose rows set the range, and the newest
        self.follows = True  # the range follows the data; off once somebody has zoomed
        self._at: tuple[float, ...] = ()  # the cursors
        self._active = 0
        self._held: int | None = None  # the cursor that is dragged
        item = self.getPlotItem()
        item.hideButtons()
        item.setContentsMargins(0, 0, 0, 0)
        item.getViewBox().setDefaultPadding(0.0)
        item.getViewBox().setMouseEnabled(x=zooms, y=True)
        item.getViewBox().sigRangeChangedManually.connect(self._zoomed)
        item.getViewBox().sigResized.connect(self._place)
        self._lines = Curves(self.viewport())
        self._marks = Cursors(theme, self.viewport())
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
        """Set how much of the past is shown."""
        self.seconds = seconds
        self.getViewBox().setLimits(xMin=-seconds, xMax=0.0)
        self.show_window(-seconds, 0.0)

    def show_window(self, left: float, right: float) -> None:
        """Show a part of that, s until the newest row."""
        self.setXRange(left, right, padding=0.0)

    @property
    def window_s(self) -> tuple[float, float]:
        """The part that is shown, s until the newest row."""
        left, right = self.getViewBox().viewRange()[0]
        return left, right

    def choose_by_box(self, on: bool) -> None:
        """Whether a drag chooses what is shown by a box, or moves it."""
        box = self.getViewBox()
        box.setMouseMode(box.RectMode if on else box.PanMode)

    def show_cursors(self, at: tuple[float, ...], active: int) -> None:
        """Show two cursors at these times (s until the newest row), or none."""
        self._at, self._active = at, active
        self._mark()

    def set_curves(self, curves: Sequence[Curve]) -> None:
        """Set which lines there are."""
        if list(curves) == list(self._curves):
            return
        self._curves = tuple(curves)
        self._frames = 0
        self._restyle()

    def draw(
        self, source: object, times: Floats, columns: Sequence[Floats], *, live: bool, scale: float = 1.0
    ) -> None:
        """Draw a column a curve, times `scale`, over the times; grey where not `live`.

        Times (s) rise, the last is now. Rows of one `source` are only ever added.
        """
        (left, right), _ = self.getViewBox().viewRange()
        if len(times) and right < 0.0:
            end = int(np.searchsorted(times, times[-1] + right, "right"))
            times, columns = times[:end], [values[:end] for values in columns]
        if self.follows and len(times):
            self._follow_new(source, times, columns, scale)
        _, (low, high) = self.getViewBox().viewRange()
        ratio = self.devicePixelRatioF()
        width, height = (max(1, round(side * ratio)) for side in (self._lines.width(), self._lines.height()))
        view = raster.View(right - left, low / scale, high / scale, width, height)
        drawn = self._lines.strip.draw(source, view, times, columns, self._inks)
        self._lines.show_strip(drawn, live=live)
        self._mark()

    def follow_again(self) -> None:
        """Let the range follow the data again."""
        self.follows, self._frames = True, 0

    def _follow_new(self, source: object, times: Floats, columns: Sequence[Floats], scale: float) -> None:
        """Widen the range for what is new; now and then make it as narrow as all of it allows."""
        known, newest_s = self._followed
        self._followed = source, float(times[-1])
        if source is not known:
            self._frames = 0
        self._frames -= 1
        since = 0 if self._frames <= 0 else int(np.searchsorted(times, newest_s, "right"))
        ends = [
            (np.fmin.reduce(new), np.fmax.reduce(new)) for new in (c[since:] for c in columns) if len(new)
        ]
        found = [end for end in ends if end[0] <= end[1]]  # not where all are missing
        if not found:
            return
        low, high = min(low for low, _ in found) * scale, max(high for _, high in found) * scale
        if self._frames <= 0:
            self._follow(float(low), float(high))
        elif low < self._low or high > self._high:
            self._follow(min(float(low), self._low), max(float(high), self._high))

    def _follow(self, low: float, high: float) -> None:
        self._frames = SHRINK_FRAMES
        spare = max(self._least - (high - low), 0.0) / 2 + MARGIN * max(high - low, self._least)
        self._low, self._high = low - spare, high + spare
        self.setYRange(self._low, self._high, padding=0.0)

    def _place(self) -> None:
        """Over the plot's field, to the pixel."""
        field = self.getViewBox().sceneBoundingRect()
        self._lines.setGeometry(self.mapFromScene(field).boundingRect())
        self._marks.setGeometry(self._lines.geometry())
        self._marks.raise_()

    def _zoomed(self, axes: Sequence[bool]) -> None:
        """Somebody has; one axis alone leaves the other as it was."""
        self.follows = self.follows and not axes[1]
        if axes[0]:
            self.zoomed.emit(*self.window_s)

    # --- cursors

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._held = self._marks.near(event.position().x() - self._marks.x())
        if self._held is None:
            super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._held is None:
            super().mouseMoveEvent(event)
            return
        left, right = self.window_s
        share = (event.position().x() - self._marks.x()) / max(1, self._marks.width())
        self.moved.emit(self._held, left + min(max(share, 0.0), 1.0) * (right - left))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self._held is None:
            super().mouseReleaseEvent(event)
        self._held = None

    def _mark(self) -> None:
        left, right = self.window_s
        box, field = self.getViewBox().rbScaleBox, None
        if box.isVisible():
            place = self.mapFromScene(box.sceneBoundingRect()).boundingRect()
            field = QRectF(place.translated(-self._marks.pos()))
        self._marks.show_marks(tuple((at - left) / (right - left) for at in self._at), self._active, field)

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
        self._lines.set_behind(theme.colour("card"))
        self._inks = raster.Inks(
            tuple(_colour(theme, curve.colour).rgba() for curve in self._curves),
            tuple(curve.dashed for curve in self._curves),
            theme.colour("card").rgba(),
        )


def css(theme: Theme, name: str) -> str:
    """Return a curve's colour for texts."""
    return _colour(theme, name).name()


def _colour(theme: Theme, name: str) -> QColor:
    return QColor(name) if name.startswith("#") else theme.colour(name)
