"""A plot that is cheap to draw 30 times a second: pyqtgraph's axes, cached, around our own raster."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np
import numpy.typing as npt
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QPointF, QRect, QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QFontMetrics, QImage, QMouseEvent, QPainter, QPaintEvent, QWheelEvent
from PySide6.QtWidgets import QApplication, QGraphicsItem, QWidget

from server_gui.core.desk.flags import FlagKind
from server_gui.views.theme import Theme
from server_gui.views.widgets import raster
from server_gui.views.widgets.cursors import CursorLayout, Cursors, LimitArrows
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.time_axis import LAST, NOW, PAUSED, TimeAxis
from server_gui.views.widgets.value_axis import ValueAxis

Floats = npt.NDArray[np.float64]
SHRINK_FRAMES: Final = 60  # a range that has become too wide is narrowed only now and then
MARGIN: Final = 0.06
OLD: Final = 0.35  # opacity of what is not live
NEAR_PX: Final = 4  # a press and a release no further apart are a click
NO_DATA: Final = "no data"


class Mouse(Enum):
    """Effect of the mouse in a plot."""

    NOTHING = "nothing"
    TIME = "time"  # the wheel zooms time alone, a double click shows all of it again, a click is told
    ALL = "all"  # wheel, drag and box zoom both axes


@dataclass(frozen=True, slots=True)
class Curve:
    """One line: its colour is a name in the palette."""

    channel: str
    colour: str
    thin: bool = False


@dataclass(frozen=True, slots=True)
class PlacedFlag:
    """Event at a time, s until the newest row."""

    at: float
    kind: FlagKind
    text: str


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
        """Draw the background, even before the first curve."""
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
        if (width, height) != size_in_pixels(self):  # until it is drawn anew, its newest is still at the end
            painter.scale(self.width() * ratio / width, self.height() * ratio / height)
        for begin, end, at in ((seam, width, 0), (0, seam, width - seam)):
            painter.drawImage(QPointF(at / ratio, 0), self._image, QRect(begin, 0, end - begin, height))
        painter.end()


class Plot(pg.PlotWidget):  # type: ignore[misc]  # pyqtgraph has no types
    """Time runs from −`seconds` to 0; the other axis follows the data, quickly out and slowly in.

    `least` is the smallest range that is shown, so that noise on a still joint stays noise. While part of the
    time is chosen with the mouse, new rows go on coming.
    """

    zoomed = Signal(float, float)  # from, to: s, until the newest row
    moved = Signal(int, float)  # which cursor, where to
    hovered = Signal(object)  # s until the newest row; None: the pointer has left
    clicked = Signal()
    fitted = Signal()  # all of the time is asked for

    def __init__(
        self, theme: Theme, seconds: float, least: float = 1.0, mouse: Mouse = Mouse.NOTHING
    ) -> None:
        super().__init__(enableMenu=False, axisItems={"bottom": TimeAxis(), "left": ValueAxis()})
        self._mouse = mouse
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
        self._pressed = QPointF()
        self._hover: float | None = None
        self._flags: Sequence[PlacedFlag] = ()
        self._limits: Sequence[float] = ()
        self._is_blank = False
        self._click = QTimer(self, singleShot=True)  # until it is no double click
        self._click.timeout.connect(self.clicked)
        item = self.getPlotItem()
        item.hideButtons()
        item.setContentsMargins(0, 0, 0, 0)
        item.getViewBox().setDefaultPadding(0.0)
        item.getViewBox().setMouseEnabled(x=mouse is not Mouse.NOTHING, y=mouse is Mouse.ALL)
        item.getViewBox().sigRangeChangedManually.connect(self._zoomed)
        item.getViewBox().sigResized.connect(self._place)
        self._lines = Curves(self.viewport())
        self._marks = Cursors(theme, self.viewport())
        self._arrows = LimitArrows(theme, self.viewport())
        self._cache_axes()
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.viewport().setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setFrameShape(pg.QtWidgets.QFrame.Shape.NoFrame)
        self.set_seconds(seconds)
        theme.changed.connect(self._restyle)
        self._restyle()
        self._be_blank(True)

    def sizeHint(self) -> QSize:
        """As small as a plot may be; layouts give it more."""
        return QSize(140, 58)

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

    @property
    def range_shown(self) -> float:
        """Range of the other axis; 0 while no value is shown."""
        low, high = self.getViewBox().viewRange()[1]
        return 0.0 if self._is_blank else float(high - low)

    def choose_by_box(self, on: bool) -> None:
        """Choose whether a drag selects what is shown by a box, or moves it."""
        box = self.getViewBox()
        box.setMouseMode(box.RectMode if on else box.PanMode)

    def show_cursors(self, at: tuple[float, ...], active: int) -> None:
        """Show two cursors at these times (s until the newest row), or none."""
        self._at, self._active = at, active
        self._mark()

    def show_hover(self, at: float | None) -> None:
        """Show a line at this time (s until the newest row), or none."""
        self._hover = at
        self._mark()

    def show_flags(self, flags: Sequence[PlacedFlag]) -> None:
        """Show what happened when."""
        self._flags = flags

    def show_limits(self, limits: Sequence[float]) -> None:
        """Show lines at these values, and arrows at the edges for those that are not in the range."""
        self._limits = limits

    def is_in_range(self, value: float) -> bool:
        """Return whether this value is in the range that is shown."""
        low, high = self.getViewBox().viewRange()[1]
        return bool(low <= value <= high)

    def set_curves(self, curves: Sequence[Curve]) -> None:
        """Set which lines there are."""
        if list(curves) == list(self._curves):
            return
        self._curves = tuple(curves)
        self._frames = 0
        self._restyle()

    def draw(
        self,
        source: object,
        times: Floats,
        columns: Sequence[Floats],
        *,
        live: bool,
        scale: float = 1.0,
        end: str = NOW,
        since_s: float | None = None,
    ) -> None:
        """Draw a column a curve, times `scale`, over the times; grey where not `live`.

        Times (s) rise; the last is `LAST` where not `live`, else what `end` says; in a recording `since_s`
        after its beginning, if given. Rows of one `source` are only ever added.
        """
        (left, right), _ = self.getViewBox().viewRange()
        if len(times) and right < 0.0:
            until = int(np.searchsorted(times, times[-1] + right, "right"))
            times, columns = times[:until], [values[:until] for values in columns]
        if self.follows and len(times):
            self._follow_new(source, times, columns, scale)
        self._be_blank(not any(np.isfinite(values).any() for values in columns))
        _, (low, high) = self.getViewBox().viewRange()
        width, height = size_in_pixels(self._lines)
        view = raster.View(right - left, low / scale, high / scale, width, height)
        drawn = self._lines.strip.draw(source, view, times, columns, self._inks)
        self._lines.show_strip(drawn, live=live)
        if self.getPlotItem().getAxis("bottom").set_end(end if live else LAST, since_s):
            self.viewport().update()  # with the curves: the scene alone would be drawn a frame later
        self._mark()

    def draw_anew(self) -> None:
        """Draw all of it the next time: what was drawn has become other than it was."""
        self._lines.strip.forget()

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
        beside = self._marks.geometry()
        room = min(self.viewport().width() - beside.right() - 2, self._theme.px(9))
        self._arrows.setGeometry(beside.right() + 2, beside.top(), max(room, 0), beside.height())
        self._cache_axes()

    def _cache_axes(self) -> None:
        """Anew: of an axis that had another length the words at its old end would stay."""
        for name in ("left", "bottom"):
            axis = self.getPlotItem().getAxis(name)
            axis.setCacheMode(QGraphicsItem.CacheMode.NoCache)
            axis.setCacheMode(QGraphicsItem.CacheMode.DeviceCoordinateCache)

    def _zoomed(self, axes: Sequence[bool]) -> None:
        """Somebody has; one axis alone leaves the other as it was."""
        self.follows = self.follows and not axes[1]
        if axes[0]:
            self.zoomed.emit(*self.window_s)

    def _be_blank(self, is_blank: bool) -> None:
        """Without a value there is nothing that an axis could measure."""
        if is_blank != self._is_blank:
            self._is_blank = is_blank
            self.getPlotItem().getAxis("left").setStyle(showValues=not is_blank)
            self._mark()

    # --- the mouse

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._pressed = event.position()
        self._held = self._marks.near(event.position().x() - self._marks.x())
        if self._held is None:
            super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._held is not None:
            self.moved.emit(self._held, self._time_at(event.position()))
            return
        super().mouseMoveEvent(event)
        self._tell_flag(event)
        if self._mouse is not Mouse.NOTHING:
            self.hovered.emit(self._time_at(event.position()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self._held is None:
            super().mouseReleaseEvent(event)
            moved = (event.position() - self._pressed).manhattanLength()
            if self._mouse is Mouse.TIME and event.button() is Qt.MouseButton.LeftButton and moved <= NEAR_PX:
                self._click.start(QApplication.doubleClickInterval())
        self._held = None

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if self._mouse is Mouse.NOTHING:
            super().mouseDoubleClickEvent(event)
            return
        self._click.stop()
        self._pressed = QPointF(-100.0, -100.0)  # its release is no click
        self.fitted.emit()

    def leaveEvent(self, event: QEvent) -> None:
        super().leaveEvent(event)
        if self._mouse is not Mouse.NOTHING:
            self.hovered.emit(None)

    def wheelEvent(self, event: QWheelEvent) -> None:
        if self._mouse is Mouse.NOTHING:
            event.ignore()  # what is around may scroll
            return
        super().wheelEvent(event)

    def _time_at(self, place: QPointF) -> float:
        left, right = self.window_s
        share = (place.x() - self._marks.x()) / max(1, self._marks.width())
        return left + min(max(share, 0.0), 1.0) * (right - left)

    def _tell_flag(self, event: QMouseEvent) -> None:
        place = self._marks.flag_near(event.position().x() - self._marks.x())
        shown = [flag for flag in self._flags if self._is_in_sight(flag)]
        set_tip(self, "" if place is None or place >= len(shown) else shown[place].text)

    def _is_in_sight(self, flag: "PlacedFlag") -> bool:
        left, right = self.window_s
        return left <= flag.at <= right

    def _mark(self) -> None:
        left, right = self.window_s
        _, (low, high) = self.getViewBox().viewRange()
        box, field = self.getViewBox().rbScaleBox, None
        if box.isVisible():
            place = self.mapFromScene(box.sceneBoundingRect()).boundingRect()
            field = QRectF(place.translated(-self._marks.pos()))

        def share(at: float) -> float:
            return (at - left) / (right - left)

        shown = CursorLayout(
            at=tuple(share(at) for at in self._at),
            active=self._active,
            hover=None if self._hover is None else share(self._hover),
            flags=tuple((share(flag.at), flag.kind) for flag in self._flags if self._is_in_sight(flag)),
            limits=tuple((high - at) / (high - low) for at in self._limits if low <= at <= high),
            box=field,
            words=NO_DATA if self._is_blank else "",
        )
        self._marks.show_marks(shown)
        out_of_sight = (0.0 if at > high else 1.0 for at in self._limits if not low <= at <= high)
        self._arrows.show_limits(tuple(dict.fromkeys(out_of_sight)))

    def _restyle(self) -> None:
        theme = self._theme
        self.setBackground(theme.colour("card"))
        metrics = QFontMetrics(theme.text_font(0.85))
        room = metrics.horizontalAdvance(PAUSED) // 2 + 2  # the widest that stands beside the end of an axis
        self.getPlotItem().layout.setContentsMargins(0, theme.px(6), room, 0)
        for name, width in (("left", 44), ("bottom", None)):
            axis = self.getPlotItem().getAxis(name)
            axis.setPen(theme.colour("border"))
            axis.setTextPen(theme.colour("dim"))
            axis.setTickFont(theme.text_font(0.85))
            axis.setStyle(tickLength=-4)
            if width is not None:
                axis.setWidth(theme.px(width))
                axis.set_label_room(metrics.height())
            else:
                axis.set_label_room(metrics.horizontalAdvance("−000 s") + theme.px(6))
        self._lines.set_behind(theme.colour("card"))
        self._inks = raster.Inks(
            tuple(theme.colour(curve.colour).rgba() for curve in self._curves),
            tuple(curve.thin for curve in self._curves),
            theme.colour("card").rgba(),
        )


def size_in_pixels(widget: QWidget) -> tuple[int, int]:
    """Return width and height of a widget in pixels of its screen, at least one each."""
    ratio = widget.devicePixelRatioF()
    return max(1, round(widget.width() * ratio)), max(1, round(widget.height() * ratio))


def css(theme: Theme, name: str) -> str:
    """Return a curve's colour for texts."""
    return theme.colour(name).name()
