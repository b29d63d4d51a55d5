"""What the window's tests share: frames that are drawn, views that are taken apart."""

from typing import Protocol

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication, QPushButton, QVBoxLayout, QWidget

from server_gui.views.alarms.events_panel import EventsPanel
from server_gui.views.alarms.strip import AlarmStrip
from server_gui.views.edits.page import Edits
from server_gui.views.experiments.bar import ExperimentBar
from server_gui.views.frame.header import Header
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.parameters.trial_bar import TrialBar
from server_gui.views.refresh_rate import SLOW, RefreshRate
from server_gui.views.robots.panel import RobotsPanel
from server_gui.views.theme import Theme
from tests.support import desk

OVERVIEW = 0  # its page, which reads anew only when the window does


class Bench(desk.Bench):
    """A desk that is drawn."""

    def draw(self, window: "MainWindow | Refreshed") -> None:
        """Frames enough for everything to have been refreshed, and Qt's own events."""
        if isinstance(window, MainWindow):
            draw_frames(window)
        else:
            window.refresh()
        QApplication.processEvents()


class Refreshed(Protocol):
    """A part of the window that is drawn when it is told."""

    def refresh(self) -> None: ...


class Around(QWidget):
    """What is around the pages, without the parameters and without what leads from one to the other."""

    def __init__(self, bench: Bench, theme: Theme) -> None:
        super().__init__()
        self.middle = QWidget()
        self.header = Header(bench.desk, theme, QPushButton("View"))
        self.alarms = AlarmStrip(bench.desk, theme, self.middle)
        self.robots, self.events = RobotsPanel(bench.desk, theme), EventsPanel(bench.desk, theme)
        column = QVBoxLayout(self)
        for part in (self.header, self.alarms, self.robots, self.middle, self.events):
            column.addWidget(part, 1 if part is self.middle else 0)
        self.resize(1400, 900)

    def refresh(self) -> None:
        """Draw a frame in which all that is read is read."""
        for part in (self.header, self.alarms, self.robots, self.events):
            part.refresh()


class Parts(QWidget):
    """The page of edits and its bars, without the rest of the window, which takes its time to be made."""

    def __init__(self, bench: Bench, theme: Theme) -> None:
        super().__init__()
        self.edits, self.trial = Edits(bench.desk, theme), TrialBar(bench.desk, of_all=True)
        self.experiment = ExperimentBar(bench.desk)
        column = QVBoxLayout(self)
        column.addWidget(self.edits, 1)
        column.addWidget(self.experiment)
        column.addWidget(self.trial)
        self.resize(900, 700)


def draw_frames(window: MainWindow) -> None:
    """Frames enough for everything to have been refreshed: what is read is read with the first."""
    window._pace = RefreshRate()
    for _ in range(2 if window.tabs.currentIndex() == OVERVIEW else SLOW + 1):
        window.refresh()


def make_every_page(window: MainWindow) -> None:
    """Also those that nobody has looked at yet."""
    assert all(room.view is not None for room in window.tabs._rooms)


def leave_unpainted(window: QWidget) -> None:
    """Let it be laid out and refreshed as ever, without a pixel: a quarter of what a window costs.

    That everything can be painted, `test_rules` sees, and each view's own tests.
    """
    window.setUpdatesEnabled(False)


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
