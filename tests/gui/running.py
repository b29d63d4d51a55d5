"""The whole window at work on robots that answer over TCP, and taken apart at its end."""

import contextlib
from collections.abc import Callable, Iterator

from PySide6.QtCore import QSettings
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from server_gui.app import FOLLOWING, App
from server_gui.core.desk.feeds import Record
from server_gui.core.settings.server_file import ServerSettings
from tests.gui.fakes import destroy, leave_unpainted
from tests.support.waiting import until

FRAME_MS = 120  # rather than 33: to draw all the time leaves little to what is waited for


@contextlib.contextmanager
def running(
    qt: QApplication, settings: ServerSettings, kept: QSettings, record: Record | None = None
) -> Iterator[App]:
    """The window of these robots, shown."""
    with App(qt, settings, kept, FOLLOWING, record) as app:
        app._timer.setInterval(FRAME_MS)
        leave_unpainted(app.window)
        app.window.show()
        yield app
        app.window.hide()
    destroy(app.window)


def wait(so: Callable[[], bool], what: str) -> None:
    """Until it is so, while the window draws."""
    until(so, what, step=lambda: QTest.qWait(10))
