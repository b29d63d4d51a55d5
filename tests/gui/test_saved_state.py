"""What is kept of a window: whatever stands in it, the next one opens, with STOP whole and in sight."""

import itertools
from pathlib import Path

import pytest
from PySide6.QtCore import QByteArray, QPoint, QRect, QSettings, QSize, Qt
from PySide6.QtWidgets import QApplication, QDockWidget, QMainWindow, QWidget

from gateway.units import Units
from server_gui.core.settings.server_file import ServerSettings
from server_gui.views.frame.docks import Area
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.frame.saved_state import (
    keep_bytes,
    kept_bytes,
    kept_look,
    kept_scale,
    kept_units,
    sha256,
)
from server_gui.views.theme import Look, Theme
from tests.gui.fakes import Bench, destroy, stop_is_whole
from tests.gui.running import running
from tests.support.desk import described

SMALL = QSize(1024, 700)
SIZES = (1.0, 1.25, 1.5, 2.0)
AREAS = (Area.LeftDockWidgetArea, Area.RightDockWidgetArea, Area.TopDockWidgetArea, Area.BottomDockWidgetArea)


@pytest.fixture
def kept(tmp_path: Path) -> QSettings:
    return QSettings(str(tmp_path / "gui.ini"), QSettings.Format.IniFormat)


def test_bytes_of_which_one_is_damaged_are_never_given_to_qt(qt: QApplication, kept: QSettings) -> None:
    """A flipped bit in them is a segmentation fault in restoreState, Qt 6.11."""
    window = QMainWindow()
    for area in AREAS:
        window.addDockWidget(area, QDockWidget())
    keep_bytes(kept, "state", window.saveState(1))
    whole = kept_bytes(kept, "state")
    assert whole == window.saveState(1)
    for place in range(0, whole.size(), 7):
        damaged = bytearray(whole.data())
        damaged[place] ^= 1 << place % 8
        kept.setValue("state", QByteArray(bytes(damaged)))
        assert kept_bytes(kept, "state") is None
    kept.setValue("state", "text")
    assert kept_bytes(kept, "state") is None
    destroy(window)


@pytest.mark.parametrize(
    "value",
    ["", "nonsense", "nan", -1, 1e300, ["a"], {"rad": "furlong", "?": 3}, QByteArray(b"\0")],
)
def test_a_window_opens_whatever_is_kept(qt: QApplication, kept: QSettings, value: object) -> None:
    for name in ("look", "scale", "units", "pinned", "geometry", "state"):
        kept.setValue(name, value)
        if isinstance(value, QByteArray):
            kept.setValue(f"{name}_sha256", sha256(value))  # whole, and yet nothing that Qt can use
    with running(qt, ServerSettings(), kept) as app:
        QApplication.processEvents()
        assert stop_is_whole(app.window)
        app.desk.shown.units.unit("", "rad")
    app.theme.set(Look.DARK, 1.0)


def test_of_what_is_kept_is_used_what_this_version_knows(kept: QSettings) -> None:
    assert (kept_look(kept), kept_scale(kept), kept_units(kept)) == (Look.DARK, 1.0, Units())
    kept.setValue("look", "light")
    kept.setValue("scale", "150")
    kept.setValue("units", {"rad": "rad", "m": "furlong", "Pa": "kPa"})
    assert (kept_look(kept), kept_scale(kept)) == (Look.LIGHT, 1.5)
    assert kept_units(kept) == Units(by_si={"rad": "rad", "Pa": "kPa"})


@pytest.mark.parametrize("at", [(5000, 40), (-3000, -2000), (300, 9000)])
def test_a_window_of_another_screen_opens_whole_on_this_one(
    theme: Theme, bench: Bench, kept: QSettings, at: tuple[int, int]
) -> None:
    before = MainWindow(bench.desk, theme, kept)
    before.resize(3840, 2100)
    before.move(*at)
    keep_bytes(kept, "geometry", before.saveGeometry())
    destroy(before)
    keep_bytes(kept, "geometry", kept_bytes(kept, "geometry") or QByteArray())
    again = MainWindow(bench.desk, theme, kept)
    again.show()
    QApplication.processEvents()
    assert again.screen().availableGeometry().contains(again.frameGeometry())
    assert stop_is_whole(again)
    destroy(again)


@pytest.mark.parametrize("scale", SIZES)
def test_stop_is_whole_in_every_arrangement_of_the_panels(
    window: MainWindow, bench: Bench, theme: Theme, scale: float
) -> None:
    theme.set(scale=scale)
    window.resize(SMALL)
    bench.draw(window)
    for areas in itertools.product(AREAS, repeat=3):
        for dock, area in zip(window.docks, areas, strict=True):
            window.addDockWidget(area, dock)
        QApplication.processEvents()
        assert window.size() == SMALL, areas
        assert stop_is_whole(window), areas
    state = window._panels.state
    window._panels.reset(window.docks)
    window._panels.restore(state)
    QApplication.processEvents()
    assert window.size() == SMALL
    assert stop_is_whole(window)


def test_a_panel_that_floats_goes_out_of_the_way_of_stop(window: MainWindow, bench: Bench) -> None:
    bench.draw(window)
    dock, header = window.docks[2], window.header
    dock.setFloating(True)
    dock.resize(400, 200)
    dock.move(header.mapToGlobal(header.stop.pos()) - QPoint(50, 20))
    QApplication.processEvents()
    top = header.mapToGlobal(QPoint(0, header.height())).y()
    assert dock.frameGeometry().top() >= top
    dock.setFloating(False)


def place(part: QWidget) -> QRect:
    return QRect(part.mapToGlobal(QPoint()), part.size())


def covers_top(window: MainWindow, dock: QDockWidget) -> bool:
    above = (window.header, window.alarms, window.others, window.page_bar)
    return any(part.isVisible() and dock.frameGeometry().intersects(place(part)) for part in above)


@pytest.fixture
def afloat(window: MainWindow, bench: Bench) -> QDockWidget:
    """A panel that floats right below the window's top."""
    window.move(0, 0)
    bench.draw(window)
    dock = window.docks[2]
    dock.setFloating(True)
    dock.resize(400, 200)
    dock.move(600, place(window.page_bar).bottom() + 1)
    QApplication.processEvents()
    return dock


def test_a_panel_that_floats_goes_out_of_the_way_of_a_window_that_moves(
    window: MainWindow, bench: Bench, afloat: QDockWidget
) -> None:
    header = window.header
    dock_y = afloat.y()
    window.move(0, dock_y - header.stop.height())
    bench.draw(window)
    assert not afloat.frameGeometry().intersects(place(header.stop))
    assert not covers_top(window, afloat)


def test_a_panel_that_floats_goes_out_of_the_way_of_the_other_robots_and_of_larger_text(
    window: MainWindow, bench: Bench, theme: Theme, afloat: QDockWidget
) -> None:
    bench.add("exo-02", 7421).take([described("exo-02")])
    window.docks[0].hide()
    bench.draw(window)
    QApplication.processEvents()
    assert window.others.isVisible()
    assert not covers_top(window, afloat)
    theme.set(scale=2.0)
    bench.draw(window)
    assert not covers_top(window, afloat)


def test_a_panel_that_floats_goes_out_of_the_way_of_the_result_of_stop_all(
    window: MainWindow, bench: Bench, afloat: QDockWidget
) -> None:
    line = place(window._middle).bottom()
    afloat.move(300, line - 100)
    QApplication.processEvents()
    assert afloat.y() == line - 100, "there is nothing in its way yet"
    bench.desk.stop_all("all")
    bench.draw(window)
    QApplication.processEvents()
    result = place(window.stopped_all)
    assert window.stopped_all.isVisible()
    assert not afloat.frameGeometry().intersects(result)
    afloat.move(300, result.y())
    QApplication.processEvents()
    assert not afloat.frameGeometry().intersects(result), "nor is it moved there"
    assert not covers_top(window, afloat)


def test_a_maximised_window_is_as_it_was(theme: Theme, bench: Bench, kept: QSettings) -> None:
    before = MainWindow(bench.desk, theme, kept)
    before.docks[2].hide()
    before.showMaximized()
    QApplication.processEvents()
    before.close()
    destroy(before)
    again = MainWindow(bench.desk, theme, kept)
    again.show()
    QApplication.processEvents()
    assert again.windowState() & Qt.WindowState.WindowMaximized
    assert again.docks[2].isHidden()
    destroy(again)
