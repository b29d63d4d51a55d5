"""What the window's tests share: frames that are drawn, views that are taken apart."""

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication, QWidget

from server_gui.views.main_window import MainWindow
from server_gui.views.pace import SLOW, Pace
from tests.support import desk

OVERVIEW = 0  # its page, which reads anew only when the window does


class Bench(desk.Bench):
    """A desk that is drawn."""

    def draw(self, window: MainWindow) -> None:
        """Frames enough for everything to have been refreshed, and Qt's own events."""
        draw_frames(window)
        QApplication.processEvents()


def draw_frames(window: MainWindow) -> None:
    """Frames enough for everything to have been refreshed: what is read is read with the first."""
    window._pace = Pace()
    for _ in range(2 if window.tabs.currentIndex() == OVERVIEW else SLOW + 1):
        window.refresh()


def destroy(widget: QWidget) -> None:
    """Take a view apart now: plots that are left to the garbage collector can crash those made meanwhile."""
    widget.close()
    widget.deleteLater()
    QApplication.sendPostedEvents(widget, QEvent.Type.DeferredDelete)


def stop_is_whole(window: MainWindow) -> bool:
    """Whether the STOP button lies within the window, with its word and some of its name."""
    stop = window.header.stop
    corners = (stop.rect().topLeft(), stop.rect().bottomRight())
    inside = all(window.rect().contains(stop.mapTo(window, corner)) for corner in corners)
    return inside and stop.width() >= stop.minimumSizeHint().width()
