"""Where a window is on its screen, and how large at first."""

from typing import Final

from PySide6.QtCore import QPoint, QSize, Qt
from PySide6.QtWidgets import QWidget

USUAL: Final = QSize(1680, 1000)  # where the screen has room for that


def opening_size(room: QSize, scale: float) -> QSize:
    """Return how large a window is that nobody has resized yet: larger text needs more of the screen."""
    return (USUAL * max(scale, 1.0)).boundedTo(room)


def onto_screen(window: QWidget) -> None:
    """Have it whole on the screen that it is on: of another one it may be too large, or beside this one."""
    if window.windowState() & (Qt.WindowState.WindowMaximized | Qt.WindowState.WindowFullScreen):
        return
    room, frame = window.screen().availableGeometry(), window.frameGeometry()
    window.resize(window.size().boundedTo(room.size() - frame.size() + window.size()))
    frame = window.frameGeometry()
    left = min(max(frame.left(), room.left()), room.right() + 1 - frame.width())
    top = min(max(frame.top(), room.top()), room.bottom() + 1 - frame.height())
    if frame.topLeft() != QPoint(left, top):
        window.move(left, top)
