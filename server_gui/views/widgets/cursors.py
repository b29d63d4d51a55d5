"""What is drawn above a plot's curves: two cursors with their letters, and the box of a zoom."""

from typing import Final

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from server_gui.views.theme import Theme

LETTERS: Final = ("A", "B")
NEAR_PX: Final = 6  # from a cursor, to take hold of it


class Cursors(QWidget):
    """Over the field of a plot; the mouse goes through. `at` are shares of the width, none where hidden."""

    def __init__(self, theme: Theme, parent: QWidget) -> None:
        super().__init__(parent)
        self._theme = theme
        self._at: tuple[float, ...] = ()
        self._active = 0
        self._box: QRectF | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.hide()

    def show_marks(self, at: tuple[float, ...], active: int, box: QRectF | None) -> None:
        """Show these from now on."""
        if (at, active, box) != (self._at, self._active, self._box):
            self._at, self._active, self._box = at, active, box
            self.setVisible(bool(at) or box is not None)
            self.update()

    def near(self, x: float) -> int | None:
        """Return the cursor that is at this place of ours, in pixels."""
        found = [(abs(share * self.width() - x), place) for place, share in enumerate(self._at)]
        distance, place = min(found, default=(NEAR_PX + 1, 0))
        return place if distance <= NEAR_PX else None

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setFont(self._theme.text_font(bold=True))
        for place, share in enumerate(self._at):
            active = place == self._active
            colour = self._theme.colour("accent" if active else "text")
            style = Qt.PenStyle.SolidLine if active else Qt.PenStyle.DashLine
            painter.setPen(QPen(colour, 1, style))
            x = round(share * self.width())
            painter.drawLine(x, 0, x, self.height())
            inside = 3 if x < self.width() / 2 else -painter.fontMetrics().horizontalAdvance("A") - 3
            painter.drawText(QPointF(x + inside, painter.fontMetrics().ascent()), LETTERS[place])
        if self._box is not None:
            painter.setPen(QPen(self._theme.colour("accent"), 1, Qt.PenStyle.DashLine))
            painter.drawRect(self._box)
        painter.end()
