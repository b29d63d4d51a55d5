"""Calibration plot of two models: predicted probability against observed accuracy."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from ml.registry.card import Bin
from server_gui.views.theme import Theme

NOTHING: Final = "not known: it was judged without probabilities"
TICKS: Final = (0.0, 0.5, 1.0)


@dataclass(frozen=True, slots=True)
class Curve:
    """A model's name and its bins; the colour's name and the shape tell it from the other."""

    name: str
    bins: Sequence[Bin]
    colour: str
    is_dashed: bool = False


class CalibrationPlot(QWidget):
    """On the diagonal what is said is as often right; below it, a model is too sure of itself."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._curves: Sequence[Curve] = ()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        theme.changed.connect(self._restyle)
        self.show_curves(())
        self._restyle()

    def sizeHint(self) -> QSize:
        return QSize(self._theme.px(240), self._theme.px(220))

    def show_curves(self, curves: Sequence[Curve]) -> None:
        """Show these from now on."""
        self._curves = curves
        self.setAccessibleName("Calibration: predicted probability, and how often it was right")
        self.setAccessibleDescription("; ".join(map(_told, curves)) or NOTHING)
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(self._theme.text_font(0.9))
        if not any(curve.bins for curve in self._curves):
            painter.setPen(self._theme.colour("dim"))
            wrap = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
            painter.drawText(self.rect(), wrap, NOTHING)
        else:
            field = self._field(painter)
            self._draw_axes(painter, field)
            for curve in self._curves:
                self._draw_curve(painter, field, curve)
        painter.end()

    def _restyle(self) -> None:
        self.setMinimumSize(self._theme.px(200), self._theme.px(170))
        self.updateGeometry()

    def _field(self, painter: QPainter) -> QRectF:
        text = painter.fontMetrics()
        left, below = text.horizontalAdvance("100 %") + 8.0, text.height() * 2.2
        return QRectF(
            left, text.height() * 1.4, self.width() - left - 10.0, self.height() - below - text.height() * 1.4
        )

    def _draw_axes(self, painter: QPainter, field: QRectF) -> None:
        line = painter.fontMetrics().height()
        painter.setPen(self._theme.colour("dim"))
        painter.drawText(QPointF(2.0, line * 0.9), "how often right")
        middle = Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop
        painter.drawText(
            QRectF(field.left(), field.bottom() + line * 1.1, field.width(), line), middle, "probability said"
        )
        for share in TICKS:
            words = f"{100 * share:.0f} %"
            wide = painter.fontMetrics().horizontalAdvance(words)
            x, y = field.left() + share * field.width(), field.bottom() - share * field.height()
            painter.drawText(QPointF(field.left() - wide - 5, y + line * 0.3), words)
            painter.drawText(
                QPointF(min(x - wide / 2, self.width() - wide - 1.0), field.bottom() + line), words
            )
        painter.setPen(QPen(self._theme.colour("border"), 1))
        painter.drawRect(field)
        painter.setPen(QPen(self._theme.colour("dim"), 1, Qt.PenStyle.DotLine))
        painter.drawLine(field.bottomLeft(), field.topRight())

    def _draw_curve(self, painter: QPainter, field: QRectF, curve: Curve) -> None:
        colour = self._theme.colour(curve.colour)
        style = Qt.PenStyle.DashLine if curve.is_dashed else Qt.PenStyle.SolidLine
        points = [
            QPointF(field.left() + one.said * field.width(), field.bottom() - one.right * field.height())
            for one in curve.bins
        ]
        painter.setPen(QPen(colour, 2, style))
        painter.drawPolyline(points)
        painter.setPen(QPen(colour, 2))
        painter.setBrush(self._theme.colour("card") if curve.is_dashed else colour)
        for point in points:
            painter.drawEllipse(point, 3.5, 3.5)


def _told(curve: Curve) -> str:
    bins = ", ".join(f"{100 * one.said:.0f} % said {100 * one.right:.0f} % right" for one in curve.bins)
    return f"{curve.name}: {bins or NOTHING}"
