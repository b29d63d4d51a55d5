"""The STOP button: acts when it is pressed, not when it is let go, and names the robot that it stops."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFontMetrics, QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QPushButton, QWidget

from gateway.plain import plain

HINT = (
    "Quick stop on every drive (F12 or Ctrl+Space). It is software over a network, NOT a safety-rated "
    "emergency stop: keep the hardware one within reach."
)
AROUND = 34  # pixels of frame and padding at both sides


class StopButton(QPushButton):
    """`stopped` is emitted the moment that it is pressed, by mouse or keyboard."""

    stopped = Signal()

    def __init__(self, name: str = "stop", parent: QWidget | None = None) -> None:
        super().__init__("STOP", parent)
        self.most: int | None = None  # wide; None: as the layout has it
        self._robot: str | None = None
        self.setObjectName(name)
        self.setToolTip(HINT)
        self.setAccessibleDescription(HINT)
        self.setAutoDefault(False)
        self.pressed.connect(self.stopped)

    def name(self, robot: str | None) -> None:
        """Say whom it stops; a name that has no room is cut in its middle, the word STOP never."""
        self._robot = robot
        self.setAccessibleName("STOP" if robot is None else f"STOP {plain(robot)}")
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._robot is not None:
            self._fit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Return presses it too."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and not event.isAutoRepeat():
            self.stopped.emit()
        else:
            super().keyPressEvent(event)

    def _fit(self) -> None:
        text = "STOP"
        if self._robot is not None:
            metrics = QFontMetrics(self.font())
            room = (self.width() if self.most is None else self.most) - AROUND
            room -= metrics.horizontalAdvance("STOP  ")
            name = metrics.elidedText(plain(self._robot), Qt.TextElideMode.ElideMiddle, max(room, 0))
            text = f"STOP  {name}"
        if self.text() != text:
            self.setText(text)
