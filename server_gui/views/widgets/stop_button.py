"""The STOP button: acts when it is pressed, not when it is let go, and says what became of it."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QPushButton, QWidget

HINT = (
    "Quick stop on every drive (F12 or Ctrl+Space). It is software over a network, NOT a safety-rated "
    "emergency stop: keep the hardware one within reach."
)


class StopButton(QPushButton):
    """`stopped` is emitted the moment that it is pressed, by mouse or keyboard."""

    stopped = Signal()

    def __init__(self, name: str = "stop", parent: QWidget | None = None) -> None:
        super().__init__("STOP", parent)
        self.setObjectName(name)
        self.setToolTip(HINT)
        self.setAccessibleDescription(HINT)
        self.setAutoDefault(False)
        self.pressed.connect(self.stopped)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Return presses it too."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and not event.isAutoRepeat():
            self.stopped.emit()
        else:
            super().keyPressEvent(event)
