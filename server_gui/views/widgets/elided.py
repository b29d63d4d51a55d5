"""A label of a name, which has … in its middle where there is no room; numbers are for `FittedLabel`."""

from PySide6.QtCore import Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy

from server_gui.views.widgets.plain import PlainLabel, set_tip


class ElidedLabel(PlainLabel):
    """One line of plain text; `mode` says where its … is."""

    def __init__(self, name: str = "", mode: Qt.TextElideMode = Qt.TextElideMode.ElideMiddle) -> None:
        super().__init__()
        self._mode = mode
        self.setObjectName(name)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        room = self.contentsRect()
        text = self.fontMetrics().elidedText(self.text(), self._mode, room.width())
        painter.drawText(room, self.alignment(), text)
        painter.end()


class PathLabel(ElidedLabel):
    """What a folder is for and where it is: a name, however many digits it has; its tip has all of it."""

    def say(self, what: str, path: str) -> None:
        """Show this."""
        text = f"{what} {path}"
        if text != self.text():
            self.setText(text)
            self.setAccessibleName(text)
            set_tip(self, text)
