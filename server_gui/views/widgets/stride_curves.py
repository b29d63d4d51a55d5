"""The mean stride before and after an edit laid over each other, each in a band of one standard deviation."""

from typing import Final

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from gateway.units import Unit
from server_gui.core.evidence.comparison import FEWEST
from server_gui.core.evidence.curves import Curves, Side
from server_gui.views.theme import Theme
from server_gui.views.widgets.plot_frame import GAP, draw_frame

Floats = npt.NDArray[np.float64]

BAND: Final = 60  # of 255: how dense one is
CYCLE: Final[tuple[str, tuple[str, ...], str]] = ("0", (), "100")  # %, as is said once above all of them


class StrideCurves(QWidget):
    """One channel over the stride: grey before, in the accent's colour after; dashed of few strides.

    `hovered` tells where the pointer is, as a share of the stride (0–1), None: nowhere; `show_hover` reads
    the curves there.
    """

    hovered = Signal(object)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._curves: Curves | None = None
        self._unit = Unit("", "")
        self._area = QRectF()  # of the curves, as it was drawn last
        self._hover: float | None = None
        self.setMouseTracking(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        theme.changed.connect(self.update)

    def sizeHint(self) -> QSize:
        return QSize(self._theme.px(180), self._theme.px(130))

    def minimumSizeHint(self) -> QSize:
        return QSize(self._theme.px(100), self._theme.px(90))

    @property
    def title(self) -> str:
        """The shown quantity, and its unit."""
        name = "" if self._curves is None else self._curves.channel.replace("_", " ").replace(".", " ")
        return f"{name} ({self._unit.symbol})" if self._unit.symbol else name

    def show_curves(self, curves: Curves, unit: Unit) -> None:
        """Draw this."""
        self._curves, self._unit = curves, unit
        low, high = self._range(curves)
        before, after = (0 if side is None else side.cycles for side in (curves.before, curves.after))
        self.setAccessibleName(self.title)
        reach = f"{unit.text(low)} to {unit.text(high)} {unit.symbol}".rstrip()
        self.setAccessibleDescription(f"{before} strides before and {after} after, from {reach}")
        self.update()

    @property
    def read(self) -> str:
        """Values of the curves at the pointer: `42 %: 12.3 → 14.0 °`; empty without a pointer."""
        if self._curves is None or self._hover is None:
            return ""
        sides = (self._curves.before, self._curves.after)
        before, after = (
            "–" if side is None else self._unit.text(side.mean[round(self._hover * (len(side.mean) - 1))])
            for side in sides
        )
        return f"{self._hover:.0%}: {before} → {after} {self._unit.symbol}".replace("%", " %", 1).rstrip()

    def show_hover(self, at: float | None) -> None:
        """Read them at this share of the stride, None: not at all."""
        if at != self._hover:
            self._hover = at
            self.update()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        area, at = self._area, event.position()
        inside = area.width() > 0 and area.left() <= at.x() <= area.right()
        self.hovered.emit((at.x() - area.left()) / area.width() if inside else None)

    def leaveEvent(self, event: QEvent) -> None:
        super().leaveEvent(event)
        self.hovered.emit(None)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._curves is not None:
            low, high = self._range(self._curves)
            up = (self._unit.text(low), self._unit.text(high))
            title = self._head(painter)
            self._area = area = draw_frame(painter, self._theme, QRectF(self.rect()), title, up, CYCLE)
            for side, colour in ((self._curves.before, "dim"), (self._curves.after, "accent")):
                if side is not None:
                    self._draw(painter, area, side, colour, low, high)
            if self._hover is not None:
                x = area.left() + self._hover * area.width()
                painter.setPen(QPen(self._theme.colour("text"), 1.0))
                painter.drawLine(QPointF(x, area.top()), QPointF(x, area.bottom()))
        painter.end()

    def _head(self, painter: QPainter) -> str:
        """Return the title, and what is read; that alone where both have no room."""
        both = f"{self.title}  {self.read}".rstrip()
        painter.setFont(self._theme.text_font(0.85))
        has_room = painter.fontMetrics().horizontalAdvance(both) < self.width() - 2 * GAP
        return both if has_room or not self.read else self.read

    def _draw(self, painter: QPainter, area: QRectF, side: Side, name: str, low: float, high: float) -> None:
        mean, deviation = np.array(side.mean), np.array(side.deviation)

        def line(values: Floats) -> list[QPointF]:
            across = np.linspace(area.left(), area.right(), len(values))
            up = area.bottom() - (values - low) / ((high - low) or 1.0) * area.height()
            return [QPointF(x, y) for x, y in zip(across.tolist(), up.tolist(), strict=True)]

        colour = self._theme.colour(name)
        band = self._theme.colour(name)
        band.setAlpha(BAND)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(band)
        painter.drawPolygon(QPolygonF([*line(mean + deviation), *reversed(line(mean - deviation))]))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        few = Qt.PenStyle.DashLine if side.cycles < FEWEST else Qt.PenStyle.SolidLine
        painter.setPen(QPen(colour, 1.5, few))
        painter.drawPolyline(QPolygonF(line(mean)))

    def _range(self, curves: Curves) -> tuple[float, float]:
        sides = [side for side in (curves.before, curves.after) if side is not None]
        ends = [
            np.array(side.mean) + sign * np.array(side.deviation) for side in sides for sign in (-1.0, 1.0)
        ]
        return (float(np.min(ends)), float(np.max(ends))) if ends else (0.0, 1.0)
