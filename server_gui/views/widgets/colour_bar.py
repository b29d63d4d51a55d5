"""The colour scale of the pressure maps, with its ends in the unit of choice."""

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QLinearGradient, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from server_gui.core.desk.desk import Desk
from server_gui.views.theme import Theme
from server_gui.views.widgets.pressure_map import FULL_PA, colour_table


class ColourBar(QWidget):
    """From 0 to the pressure maps' largest."""

    def __init__(self, desk: Desk, theme: Theme, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._desk = desk
        self._theme = theme
        self._colours = [QColor(number) for number in colour_table()]
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        self.setAccessibleName("Colours of the pressure maps")

    def sizeHint(self) -> QSize:
        return QSize(self._theme.px(46), 100)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setFont(self._theme.text_font(0.85))
        line = painter.fontMetrics().height()
        bar = QRectF(4, line * 1.6, self._theme.px(8), self.height() - line * 2.6)
        gradient = QLinearGradient(bar.bottomLeft(), bar.topLeft())
        for place in range(0, len(self._colours), 16):
            gradient.setColorAt(place / (len(self._colours) - 1), self._colours[place])
        painter.fillRect(bar, gradient)
        painter.setPen(self._theme.colour("dim"))
        unit = self._desk.shown.units.unit("pressure", "Pa")
        painter.drawText(QRectF(0, 0, self.width(), line), Qt.AlignmentFlag.AlignLeft, unit.symbol)
        for share in (0.0, 0.5, 1.0):
            y = bar.bottom() - share * bar.height() - line / 2
            text = f"{FULL_PA * share * unit.scale:g}"
            painter.drawText(QRectF(bar.right() + 4, y, self.width(), line), Qt.AlignmentFlag.AlignLeft, text)
        painter.end()
