"""Qt without a screen for every test here; a mistake in a slot fails the test that made it."""

import gc
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

os.environ["QT_QPA_PLATFORM"] = "offscreen"

from PySide6.QtCore import QEventLoop, QSettings, Qt, QtMsgType, qInstallMessageHandler
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from server_gui.core.desk.desk import Desk
from server_gui.views.frame.garbage import Garbage
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.frame.on_screen import USUAL
from server_gui.views.overview.page import Overview
from server_gui.views.parameters.panel import ParametersPanel
from server_gui.views.theme import Look, Theme
from tests.gui.archives import (  # noqa: F401  # fixtures, for every test here
    archive,
    full_window,
    played,
    posted,
    settings,
    shown,
    whole,
)
from tests.gui.fakes import Around, Bench, Parts, destroy, leave_unpainted
from tests.support.desk import described, looked


def _quiet(kind: QtMsgType, _context: object, text: str) -> None:
    if "propagateSizeHints" not in text:
        sys.stderr.write(f"{kind.name}: {text}\n")


@pytest.fixture(scope="session")
def qt() -> QApplication:
    """The one application of this process."""
    qInstallMessageHandler(_quiet)
    application = QApplication.instance()
    if not isinstance(application, QApplication):
        application = QApplication([])
        application.setStyle("Fusion")
    return application


@pytest.fixture(scope="package", autouse=True)
def garbage() -> Iterator[Garbage]:
    """As in a process with a window: widgets that another thread's collection destroys end in a deadlock."""
    yield Garbage()
    gc.collect()
    gc.enable()


@pytest.fixture(autouse=True)
def slots_raise_nothing(
    qt: QApplication, garbage: Garbage, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """What a slot raises reaches nobody: here it fails the test."""
    raised: list[str] = []
    monkeypatch.setattr(
        sys, "excepthook", lambda kind, error, _trace: raised.append(f"{kind.__name__}: {error}")
    )
    yield
    qt.processEvents(QEventLoop.ProcessEventsFlag.AllEvents)
    garbage.look()
    assert raised == []


@pytest.fixture(autouse=True)
def hands_off(qt: QApplication) -> Iterator[None]:
    """Let go of mouse and keys: Qt remembers what the last event had, and with Shift a row is not chosen."""
    yield
    if qt.keyboardModifiers() or qt.mouseButtons():
        QTest.mouseRelease(QWidget(), Qt.MouseButton.LeftButton)
    assert qt.keyboardModifiers() == Qt.KeyboardModifier.NoModifier
    assert qt.mouseButtons() == Qt.MouseButton.NoButton


@pytest.fixture(scope="session")
def only_theme(qt: QApplication) -> Theme:
    return Theme(qt)


@pytest.fixture
def theme(only_theme: Theme) -> Theme:
    """Dark and of usual size, whatever the test before has made of it."""
    if (only_theme.look, only_theme.scale) != (Look.DARK, 1.0):
        only_theme.set(Look.DARK, 1.0)
    return only_theme


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A desk with one robot that has described itself.

    What it has said gets old in a minute: to draw it takes a busy computer longer than half a second.
    """
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 60_000_000_000)
    made = Bench(Desk())
    made.add("exo-01").take([described()])
    return made


@pytest.fixture
def window(qt: QApplication, theme: Theme, bench: Bench, tmp_path: Path) -> Iterator[MainWindow]:
    """The main window on that desk, shown."""
    kept = QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)
    made = MainWindow(bench.desk, theme, kept)
    made.resize(USUAL)  # the screen of no display is small
    leave_unpainted(made)
    made.show()
    bench.draw(made)
    yield made
    destroy(made)


@pytest.fixture
def overview(theme: Theme, bench: Bench) -> Iterator[Overview]:
    """The overview alone."""
    made = Overview(bench.desk, theme)
    made.resize(1000, 800)
    made.show()
    yield made
    destroy(made)


@pytest.fixture
def panel(theme: Theme, bench: Bench) -> Iterator[ParametersPanel]:
    """The panel of a robot whose parameters have been read."""
    bench.station.take([looked()])
    made = ParametersPanel(bench.desk, theme)
    made.resize(420, 900)
    made.show()
    made.refresh()
    yield made
    destroy(made)


@pytest.fixture
def parts(theme: Theme, bench: Bench) -> Iterator[Parts]:
    """The page of edits and its bars."""
    made = Parts(bench, theme)
    made.show()
    yield made
    destroy(made)


@pytest.fixture
def around(theme: Theme, bench: Bench) -> Iterator[Around]:
    """Header, alarms, robots and events."""
    made = Around(bench, theme)
    made.show()
    bench.draw(made)
    yield made
    destroy(made)
