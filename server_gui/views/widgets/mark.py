"""A state's shape as a small widget."""

from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QIcon, QPainter, QPaintEvent, QPixmap
from PySide6.QtWidgets import QSizePolicy, QWidget

from server_gui.views.marks import Mark, draw
from server_gui.views.theme import Theme

SIDE: Final = 11  # at text of 100 %


def mark_icon(theme: Theme, mark: Mark) -> QIcon:
    """Return a mark for a line of a menu."""
    side = theme.px(SIDE)
    drawn = QPixmap(side, side)
    drawn.fill(Qt.GlobalColor.transparent)
    painter = QPainter(drawn)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    draw(painter, mark, theme.colour(mark.colour), QRectF(0, 0, side, side))
    painter.end()
    return QIcon(drawn)


class MarkIcon(QWidget):
    """Draws a mark; redraws only when it becomes another."""

    def __init__(self, theme: Theme, size: int = SIDE, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._theme = theme
        self._pixels = size
        self._mark = Mark("ring", "old")
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self.updateGeometry)

    def show_mark(self, mark: Mark) -> None:
        """Show this one from now on."""
        if mark != self._mark:
            self._mark = mark
            self.setAccessibleName(mark.word)
            self.update()

    @property
    def mark(self) -> Mark:
        """The shown mark."""
        return self._mark

    def sizeHint(self) -> QSize:
        side = self._theme.px(self._pixels)
        return QSize(side, side)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        side = float(min(self.width(), self.height()))
        draw(painter, self._mark, self._theme.colour(self._mark.colour), QRectF(0, 0, side, side))
        painter.end()
