"""What the window's tests share: frames that are drawn, views that are taken apart."""

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication, QWidget

from server_gui.views.main_window import MainWindow
from tests.support import desk


class Bench(desk.Bench):
    """A desk that is drawn."""

    def draw(self, window: MainWindow) -> None:
        """Frames enough for everything to have been refreshed, and Qt's own events."""
        for _ in range(7):
            window.refresh()
        QApplication.processEvents()


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
