"""A foot's pressure from above: cells smoothed by precomputed weights, the centre of pressure, its trail."""

import collections
import functools
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QBrush, QColor, QImage, QPainter, QPainterPath, QPaintEvent, QPen, QPixmap
from PySide6.QtWidgets import QSizePolicy, QWidget

from server_gui.core.desk.soles import Cell
from server_gui.views.theme import Theme

FULL_PA: Final = 250_000.0  # the colour scale's end
LENGTH_M, WIDTH_M = 0.272, 0.104  # what the picture covers, behind the heel to before the toes
BEHIND_M: Final = 0.004
FARTHEST_M, WIDEST_M = 0.250, 0.044  # from heel and middle, where cells of this foot can be
COLUMNS, ROWS = 40, 104  # pixels of the picture
SPREAD_M: Final = 0.017  # of one cell
TRAIL: Final = 18
HALF: Final = 0.5  # of what a pixel shows, that must be known
DARK: Final = "#1b2128"  # around the trail, in either look: pressures have the same colours in both
STEPS: Final = 255  # colours of the scale; the last place of the table is transparent

# The left foot from above (x forward, y left, mm): heel, outer side, toes, inner side.
OUTLINE: Final = (
    (0, 0), (10, 22), (40, 31), (100, 34), (150, 42), (185, 45), (215, 37), (240, 18), (262, -8),
    (266, -24), (250, -39), (215, -42), (180, -46), (150, -41), (110, -26), (70, -25), (35, -30), (10, -22),
)  # fmt: skip

Weights = npt.NDArray[np.float32]
VIRIDIS: Final = pg.colormap.get("viridis")


class PressureMap(QWidget):
    """One foot. Cells without a place are drawn as bars in their order."""

    def __init__(self, theme: Theme, side: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._theme = theme
        self._side = side
        self._sign = 1.0 if side == "left" else -1.0
        self._weights: Weights | None = None
        self._cells: tuple[Cell, ...] | None = None
        self._size = 1.0
        self._pressures: npt.NDArray[np.float32] = np.zeros(0, np.float32)
        self._image = QImage(COLUMNS, ROWS, QImage.Format.Format_Indexed8)
        self._image.setColorTable(colour_table())
        self._trail: collections.deque[Cell | None] = collections.deque(maxlen=TRAIL)
        self._live = False
        self._words = ""
        self.missing: tuple[int, ...] = ()  # cells without a value
        self._path = outline(self._sign)
        self._template_key: tuple[object, ...] = ()
        self._template_made = QPixmap()
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(60, 76)
        self.setAccessibleName(f"Pressure under the {side} foot")

    def sizeHint(self) -> QSize:
        return QSize(70, 100)

    def set_cells(self, cells: tuple[Cell, ...] | None) -> None:
        """Set where the cells are (m), None where nobody knows. A larger foot is drawn as large as this."""
        self._size = size_of(cells or ())
        self._cells = None if cells is None else tuple((x / self._size, y / self._size) for x, y in cells)
        self._weights = None if self._cells is None else weights(self._cells)
        self._trail.clear()

    def say(self, words: str, value: str = "") -> None:
        """Say this across the sole: why nothing is known of it; else `value` is read aloud."""
        self.setAccessibleDescription(words or value)
        if words != self._words:
            self._words = words
            self.update()

    def show_pressures(self, pressures: Sequence[float | None], cop: Cell | None, *, live: bool) -> None:
        """Draw these pressures (Pa, cell after cell) and the centre of pressure (m)."""
        self.missing = tuple(place for place, value in enumerate(pressures) if value is None)
        self._pressures = np.array([0.0 if value is None else value for value in pressures], np.float32)
        self._live = live
        self._trail.append(None if cop is None else (cop[0] / self._size, cop[1] / self._size))
        if self._weights is not None and self._weights.shape[1] == len(self._pressures):
            self._fill(self._weights)
        self.update()

    def _fill(self, shares: Weights) -> None:
        """By the cells that have a value; where most is that of cells without one, nothing is drawn."""
        field, known = shares @ self._pressures, np.ones(len(shares), np.float32)
        if self.missing:
            known -= shares[:, list(self.missing)].sum(axis=1) / (shares.sum(axis=1) + 1e-9)
            field /= np.maximum(known, HALF)
        indices = np.clip(field * (STEPS / FULL_PA), 0, STEPS - 1).astype(np.uint8)
        indices[known < HALF] = STEPS
        view = np.frombuffer(self._image.bits(), np.uint8).reshape(ROWS, self._image.bytesPerLine())
        view[:, :COLUMNS] = indices.reshape(ROWS, COLUMNS)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), self._theme.colour("card"))
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        if self.missing:
            painter.fillRect(self.rect(), self._hatch())
        scale = self._to_metres(painter)
        if self._weights is None:
            self._draw_bars(painter)
        else:
            painter.setOpacity(1.0 if self._live else 0.35)
            painter.drawImage(QRectF(-WIDTH_M / 2, BEHIND_M - LENGTH_M, WIDTH_M, LENGTH_M), self._image)
            painter.setOpacity(1.0)
        painter.resetTransform()
        painter.drawPixmap(0, 0, self._template())
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._to_metres(painter)
        self._draw_trail(painter, 4.0 / scale)
        painter.resetTransform()
        self._draw_words(painter)
        painter.end()

    def _draw_words(self, painter: QPainter) -> None:
        if not self._words:
            return
        painter.setFont(self._theme.text_font(bold=True))
        bounds = painter.boundingRect(
            self.rect(), Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap, self._words
        )
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self._theme.colour("card"))
        painter.drawRoundedRect(bounds.adjusted(-5, -3, 5, 3), 3, 3)
        painter.setPen(self._theme.colour("bad"))
        painter.drawText(bounds, Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap, self._words)

    def _hatch(self) -> QBrush:
        return QBrush(self._theme.colour("old"), Qt.BrushStyle.BDiagPattern)

    def _to_metres(self, painter: QPainter) -> float:
        """From now on x is to the right and y down in m, the heel at the origin; pixels a metre."""
        scale = min(self.height() / LENGTH_M, self.width() / WIDTH_M) * 0.98
        box = QRectF(0, 0, WIDTH_M * scale, LENGTH_M * scale)
        box.moveCenter(QRectF(self.rect()).center())
        painter.translate(box.center().x(), box.bottom() - BEHIND_M * scale)
        painter.scale(scale, scale)
        return scale

    def _template(self) -> QPixmap:
        """All but the pressure: what is around the sole, its edge, the cells; made when one changes."""
        ratio = self.devicePixelRatioF()
        key = (self.size(), ratio, self._theme.colours, self._live, self._cells)
        if key != self._template_key:
            self._template_key = key
            self._template_made = QPixmap(self.size() * ratio)
            self._template_made.setDevicePixelRatio(ratio)
            self._template_made.fill(Qt.GlobalColor.transparent)  # so that a hole can be made into it
            self._draw_template(QPainter(self._template_made))
        return self._template_made

    def _draw_template(self, painter: QPainter) -> None:
        painter.fillRect(self.rect(), self._theme.colour("card"))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        scale = self._to_metres(painter)
        painter.setCompositionMode(QPainter.CompositionMode.CompositionMode_Clear)
        painter.fillPath(self._path, QColor("black"))
        painter.setCompositionMode(QPainter.CompositionMode.CompositionMode_SourceOver)
        painter.setPen(_cosmetic(self._theme.colour("dim" if self._live else "old"), 1.4))
        painter.drawPath(self._path)
        if self._cells is not None:
            self._draw_dots(painter, self._cells, 1.6 / scale)
        painter.end()

    def _draw_bars(self, painter: QPainter) -> None:
        count = max(1, len(self._pressures))
        height = LENGTH_M / count
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self._theme.colour(self._side if self._live else "old"))
        for number, pressure in enumerate(self._pressures):
            if number not in self.missing:  # there the hatching stays
                row = QRectF(-WIDTH_M / 2, -height * (number + 1), WIDTH_M, height)
                painter.fillRect(row, self._theme.colour("card"))
            width = min(float(pressure) / FULL_PA, 1.0) * WIDTH_M
            painter.drawRect(QRectF(-WIDTH_M / 2, -height * (number + 1), width, height * 0.8))

    def _draw_dots(self, painter: QPainter, cells: tuple[Cell, ...], radius: float) -> None:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(255, 255, 255, 110))
        for x, y in cells:
            painter.drawEllipse(QPointF(-y, -x), radius, radius)

    def _draw_trail(self, painter: QPainter, radius: float) -> None:
        newest = self._trail[-1] if self._trail else None
        points = [QPointF(-cop[1], -cop[0]) for cop in self._trail if cop is not None]
        if newest is None or not self._live:
            return
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(_cosmetic(QColor(DARK), 3.4))
        painter.drawPolyline(points)
        painter.setPen(_cosmetic(QColor("white"), 1.4))
        painter.drawPolyline(points)
        painter.setBrush(QColor("white"))
        painter.setPen(_cosmetic(self._theme.colour("stop"), 1.5))
        painter.drawEllipse(points[-1], radius, radius)


def _cosmetic(colour: QColor, width: float) -> QPen:
    pen = QPen(colour, width)
    pen.setCosmetic(True)
    return pen


def size_of(cells: Sequence[Cell]) -> float:
    """Return the size of a foot with these cells in outlines; 1 if they are within it."""
    return max([1.0, *(x / FARTHEST_M for x, _ in cells), *(abs(y) / WIDEST_M for _, y in cells)])


def weights(cells: Sequence[Cell]) -> Weights:
    """(pixels, cells): what each cell adds to each pixel; the picture's top left is before the toes, left."""
    down, across = np.mgrid[0:ROWS, 0:COLUMNS] + 0.5
    x = LENGTH_M - BEHIND_M - down.ravel() / ROWS * LENGTH_M
    y = WIDTH_M / 2 - across.ravel() / COLUMNS * WIDTH_M
    places = np.array(cells, np.float64)
    apart = (x[:, None] - places[:, 0]) ** 2 + (y[:, None] - places[:, 1]) ** 2
    bells = np.exp(-apart / (2 * SPREAD_M**2))
    # Near a cell its own pressure, between cells their mean, far from all of them nothing.
    near = np.minimum(bells.sum(axis=1) * 1.6, 1.0)
    found: Weights = (bells / (bells.sum(axis=1, keepdims=True) + 1e-9) * near[:, None]).astype(np.float32)
    return found


@functools.cache
def colour_table() -> tuple[int, ...]:
    """Viridis as Qt's 32-bit colours: even in print, and for those who do not tell red from green."""
    colours = VIRIDIS.getLookupTable(nPts=STEPS)
    return (*(QColor(*(int(part) for part in colour[:3])).rgb() for colour in colours), 0)


def outline(sign: float) -> QPainterPath:
    """Return the sole's edge in m, as it is drawn; `sign` is −1 for a right foot."""
    points = [QPointF(-sign * y / 1000, -x / 1000) for x, y in OUTLINE]
    path = QPainterPath((points[-1] + points[0]) / 2)
    for here, following in zip(points, [*points[1:], points[0]], strict=True):
        path.quadTo(here, (here + following) / 2)
    path.closeSubpath()
    return path
