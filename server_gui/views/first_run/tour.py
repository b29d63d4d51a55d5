"""A tour of five steps: a line of words at a time, and a frame around what they are about."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QRect, Qt, Signal
from PySide6.QtGui import QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QDockWidget, QHBoxLayout, QPushButton, QWidget

from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Theme
from server_gui.views.widgets.wrapping_label import WrappingLabel

FRAME: Final = 3  # wide


@dataclass(frozen=True, slots=True)
class Stop:
    """Words, and the part of the window that they are about."""

    title: str
    words: str
    where: Callable[[MainWindow], QWidget]


STOPS: Final = (
    Stop(
        "at a glance",
        "the robot's state is at the top beside STOP, alarms below, whatever tab is open. What is not known "
        "now is grey.",
        lambda window: window.header,
    ),
    Stop(
        "STOP",
        "a quick stop on every drive, also by F12 and Ctrl+Space; not a safety-rated emergency stop. Try it, "
        "then Reset stop and Start walking.",
        lambda window: window.header.stop,
    ),
    Stop(
        "overview",
        "what the wearer does, posture, pressure, every joint. Break something and look where it shows.",
        lambda window: window.tabs,
    ),
    Stop(
        "parameters",
        "a new value is staged, not sent. Review shows old and new; the robot reverts a trial by itself "
        "unless you keep it.",
        lambda window: window.parameters,
    ),
    Stop(
        "afterwards",
        "everything is recorded: Recordings plays it, Edits shows the effect of each change on the walk, "
        "Audit who changed what. F1 explains each tab.",
        lambda window: window.page_bar,
    ),
)


class Outline(QWidget):
    """A frame around a part of the window; the mouse goes through."""

    def __init__(self, window: MainWindow, theme: Theme) -> None:
        super().__init__(window)
        self._window = window
        self._theme = theme
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.hide()

    def surround(self, part: QWidget) -> None:
        """Stand around what is in sight of this part; nowhere while that is nothing."""
        seen = part.visibleRegion().boundingRect()
        self.setVisible(part.isVisible() and not seen.isEmpty())
        if self.geometry() != (wanted := QRect(part.mapTo(self._window, seen.topLeft()), seen.size())):
            self.setGeometry(wanted)
        self.raise_()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setPen(QPen(self._theme.colour("accent"), FRAME))
        inset = FRAME // 2 + 1
        painter.drawRect(self.rect().adjusted(inset, inset, -inset, -inset))
        painter.end()


class Tour(QWidget):
    """`left` when somebody has skipped the rest, or has seen the last."""

    left = Signal()

    def __init__(self, window: MainWindow, theme: Theme) -> None:
        super().__init__()
        self._window = window
        self._outline = Outline(window, theme)
        self.at = 0
        self.words = WrappingLabel()
        self.back, self.next, self.skip = (
            QPushButton("Back"),
            QPushButton("Next"),
            QPushButton("Skip tour"),
        )
        self.next.setObjectName("primary")
        self.back.clicked.connect(lambda: self.go(self.at - 1))
        self.next.clicked.connect(lambda: self.go(self.at + 1))
        self.skip.clicked.connect(self.end)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 0, 10, 0)
        row.setSpacing(6)
        row.addWidget(self.words, 1)
        for button in (self.back, self.next, self.skip):
            row.addWidget(button, 0, Qt.AlignmentFlag.AlignVCenter)
        self.hide()

    def begin(self) -> None:
        """Begin from the first stop."""
        self.show()
        self.go(0)

    def go(self, at: int) -> None:
        """Go to a stop; behind the last it ends."""
        if at >= len(STOPS):
            self.end()
            return
        self.at = max(at, 0)
        stop = STOPS[self.at]
        self.words.setText(f"{self.at + 1} of {len(STOPS)}, {stop.title}: {stop.words}")
        self.setAccessibleName(f"Tour, {self.words.text()}")
        self.back.setEnabled(self.at > 0)
        self.next.setText("Done" if self.at == len(STOPS) - 1 else "Next")
        self.skip.setVisible(self.at < len(STOPS) - 1)
        _bring_forward(self._window, stop.where(self._window))
        self.refresh()

    def end(self) -> None:
        """No more of it."""
        self.hide()
        self._outline.hide()
        self.left.emit()

    def refresh(self) -> None:
        """Keep the frame where its part is."""
        if not self.isHidden():
            self._outline.surround(STOPS[self.at].where(self._window))


def _bring_forward(window: MainWindow, part: QWidget) -> None:
    """Show the panel that it is in, which may be behind others or hidden."""
    around: QWidget | None = part
    while around is not None and not isinstance(around, QDockWidget):
        around = around.parentWidget()
    if isinstance(around, QDockWidget):
        window.bring(around)
