"""Bar of a bus's load, with named marks where it is busy and where it is full."""

from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from server_gui.core.processing.bus_health import BUSY_PERCENT, FULL_PERCENT
from server_gui.views.theme import Theme

BAR: Final = 10  # high, at text of 100 %
GAP: Final = 4
WORDINGS: Final = (
    (f"busy from {BUSY_PERCENT:.0f} %", f"full from {FULL_PERCENT:.0f} %"),
    (f"busy {BUSY_PERCENT:.0f} %", f"full {FULL_PERCENT:.0f} %"),
)


class LoadBar(QWidget):
    """The full bar is all of the bus's time; below it stand the names of its marks."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._percent: float | None = None
        self._colour = "old"
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Load of the bus")
        theme.changed.connect(self.updateGeometry)

    @property
    def marks(self) -> tuple[str, str]:
        """The names of the marks, in the wording that has room."""
        return next((each for each in WORDINGS if self._has_room(*each)), WORDINGS[-1])

    def sizeHint(self) -> QSize:
        return QSize(160, self._theme.px(BAR) + self.fontMetrics().height())

    def show_load(self, percent: float | None, colour: str) -> None:
        """Show this; None: not known."""
        if (percent, colour) != (self._percent, self._colour):
            self._percent, self._colour = percent, colour
            self.setAccessibleDescription("not known" if percent is None else f"{percent:.0f} %")
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        high = self._theme.px(BAR)
        box = QRectF(0, 0, self.width(), high)
        painter.fillRect(box, self._theme.colour("field"))
        if self._percent is None:
            painter.setBrush(Qt.BrushStyle.BDiagPattern)
            painter.fillRect(box, painter.brush())
        else:
            taken = QRectF(box)
            taken.setWidth(box.width() * min(self._percent, 100.0) / 100)
            painter.fillRect(taken, self._theme.colour(self._colour))
        painter.setPen(self._theme.colour("border"))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(box.adjusted(0, 0, -1, -1))
        right, bottom = Qt.AlignmentFlag.AlignRight, Qt.AlignmentFlag.AlignBottom
        for words, percent, end in zip(
            self.marks, (BUSY_PERCENT, FULL_PERCENT), (self._at(BUSY_PERCENT), self.width()), strict=True
        ):
            x = round(self._at(percent))
            painter.setPen(self._theme.colour("text"))
            painter.drawLine(x, 0, x, high)
            painter.setPen(self._theme.colour("dim"))
            painter.drawText(QRectF(0, high, end, self.height() - high), right | bottom, words)
        painter.end()

    def _at(self, percent: float) -> float:
        return self.width() * percent / 100

    def _has_room(self, busy: str, full: str) -> bool:
        wide = self.fontMetrics().horizontalAdvance
        return self.width() - wide(full) >= self._at(BUSY_PERCENT) + GAP and wide(busy) <= self._at(
            BUSY_PERCENT
        )
