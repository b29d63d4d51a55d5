"""A spin box that ignores the mouse wheel while it has no focus."""

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPolygonF, QWheelEvent
from PySide6.QtWidgets import QSpinBox


class NoWheelSpin(QSpinBox):
    """The wheel changes it only when it has the focus; its arrows are drawn in the colour of its text."""

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self.palette().text())
        side = self.fontMetrics().height() / 3
        x, middle = self.width() - side - 4, self.height() / 2
        for way in (-1, 1):
            foot, tip = middle + way * 2, middle + way * (2 + side * 0.8)
            points = ((x - side / 2, foot), (x + side / 2, foot), (x, tip))
            painter.drawPolygon(QPolygonF([QPointF(*point) for point in points]))
        painter.end()

    def wheelEvent(self, event: QWheelEvent) -> None:
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()
