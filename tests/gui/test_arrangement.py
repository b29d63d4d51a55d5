"""Panels stay as people have arranged them, whatever becomes of the window, its text and its robots."""

from pathlib import Path

import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtTest import QTest

from gateway.wire.parameter import Written
from server_gui.core.desk.desk import Desk
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench, destroy
from tests.support.desk import described, looked, walking

MINE = (260, 540)  # wide: robots and parameters, as somebody has made them


@pytest.fixture
def arranged(window: MainWindow, bench: Bench) -> MainWindow:
    window.setUpdatesEnabled(True)  # its layouts come to rest as it is painted
    window.resize(1600, 900)
    bench.look_again([walking(20), looked()])
    for _ in range(3):
        bench.draw(window)
    window.resizeDocks(window.docks[:2], MINE, Qt.Orientation.Horizontal)
    for _ in range(2):  # as it comes to rest, and what it has come to
        bench.draw(window)
    assert widths(window) == MINE
    return window


def widths(window: MainWindow) -> tuple[int, ...]:
    return tuple(dock.width() if dock.isVisible() else 0 for dock in window.docks[:2])


@pytest.mark.parametrize("narrow", [1190, 960, 780, 640])
def test_a_window_that_was_narrow_for_a_while_gives_them_their_widths_back(
    arranged: MainWindow, bench: Bench, narrow: int
) -> None:
    arranged.resize(narrow, 900)
    bench.draw(arranged)
    assert arranged._panels.is_narrow
    kept = arranged._panels.state
    arranged.resize(1600, 900)
    bench.draw(arranged)
    assert widths(arranged) == MINE
    arranged.resizeDocks(arranged.docks[:2], [200, 400], Qt.Orientation.Horizontal)
    arranged._panels.restore(kept)
    bench.draw(arranged)
    assert widths(arranged) == MINE, "nor is what is kept over the end of the program squeezed"


def test_another_start_has_the_arrangement_of_before_also_after_one_in_a_narrow_window(
    theme: Theme, tmp_path: Path
) -> None:
    file = str(tmp_path / "kept.ini")
    for wide in (1600, 1600, 1000, 1600, 1000):
        desk = Bench(Desk())
        desk.add("exo-01").take([described(), walking(20), looked()])
        kept = QSettings(file, QSettings.Format.IniFormat)
        is_first = not kept.contains("state")
        window = MainWindow(desk.desk, theme, kept)
        window.resize(wide, 900)
        window.show()
        for _ in range(3):
            desk.draw(window)
        if is_first:
            window.docks[2].hide()
            window.resizeDocks(window.docks[:2], MINE, Qt.Orientation.Horizontal)
            for _ in range(2):
                desk.draw(window)
        if wide == 1000:
            window.resize(1600, 900)
            for _ in range(2):
                desk.draw(window)
        assert widths(window) == MINE
        assert not window.docks[2].isVisible()
        window.resize(wide, 900)
        desk.draw(window)
        window.close()
        window.kept.sync()
        destroy(window)


@pytest.mark.parametrize("least", [1200, 1280, 980])
def test_so_does_one_that_is_dragged_narrow_and_wide(arranged: MainWindow, bench: Bench, least: int) -> None:
    """Frames are drawn meanwhile: each would take what is squeezed for what somebody wants."""
    there = range(1600, least - 1, -40)
    for width in (*there, *reversed(there)):
        arranged.resize(width, 900)
        bench.draw(arranged)
    for _ in range(2):
        bench.draw(arranged)
    assert widths(arranged) == MINE


def test_what_is_hidden_while_pages_are_of_no_robot_is_hidden_after_a_narrow_window_too(
    full_window: MainWindow, bench: Bench
) -> None:
    window = full_window
    window.resize(1600, 900)
    bench.look_again([walking(20), looked()])
    for _ in range(3):
        bench.draw(window)
    window.tabs.look_at_recordings()
    window.docks[2].hide()
    bench.draw(window)
    for width in (1000, 1600):
        window.resize(width, 900)
        for _ in range(2):
            bench.draw(window)
    assert not window.docks[2].isVisible()
    assert window.docks[0].isVisible()
    window.tabs.look_at(window.tabs.overview)
    bench.draw(window)
    assert window.docks[1].isVisible()


def test_a_window_that_begins_without_a_robot_gives_its_first_one_panels_of_the_usual_size(
    theme: Theme, tmp_path: Path
) -> None:
    """They were as wide as half of it."""
    desk = Bench(Desk())
    window = MainWindow(desk.desk, theme, QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat))
    window.resize(1440, 900)
    window.show()
    desk.draw(window)
    assert widths(window) == (0, 0)
    desk.add("exo-01").take([described(), walking(20), looked()])
    for _ in range(3):
        desk.draw(window)
    assert widths(window) == (190, 492)
    destroy(window)


def test_so_does_one_whose_last_robot_went_for_a_while(arranged: MainWindow, bench: Bench) -> None:
    bench.desk.remove(bench.station)
    bench.draw(arranged)
    assert widths(arranged) == (0, 0)
    bench.add("exo-01")
    bench.draw(arranged)
    assert widths(arranged) == MINE


def test_a_panel_that_floats_goes_on_to_while_the_window_is_narrow(
    arranged: MainWindow, bench: Bench
) -> None:
    floating = arranged.docks[1]
    floating.setFloating(True)
    bench.draw(arranged)
    for width in (1000, 1600):
        arranged.resize(width, 900)
        for _ in range(2):
            bench.draw(arranged)
        assert (floating.isVisible(), floating.isFloating()) == (True, True)


@pytest.mark.parametrize("way", ["text", "window"])
def test_what_somebody_has_put_away_stays_away(
    arranged: MainWindow, bench: Bench, theme: Theme, way: str
) -> None:
    arranged._panels.put_away()
    bench.draw(arranged)
    if way == "text":
        theme.set(scale=2.0)
    else:
        arranged.resize(780, 900)
    bench.draw(arranged)
    theme.set(scale=1.0)
    arranged.resize(1600, 900)
    bench.draw(arranged)
    assert not any(dock.isVisible() for dock in arranged.docks)


def test_keys_of_the_parameters_bring_them_into_sight(arranged: MainWindow, bench: Bench) -> None:
    arranged.parameters.stage_text("gait.step_length", "430")
    arranged._panels.put_away()
    bench.draw(arranged)
    QTest.keyClick(arranged, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    bench.draw(arranged)
    assert not arranged.parameters.review.visibleRegion().isEmpty()
    arranged.parameters.review.back.emit()
    bench.station.edits.drop("gait.step_length")
    bench.station.writing.undo.append({"gait.step_length": 0.41})
    arranged._panels.put_away()
    bench.draw(arranged)
    QTest.keyClick(arranged, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    bench.draw(arranged)
    assert "gait.step_length" in bench.station.edits.staged
    assert not arranged.parameters.visibleRegion().isEmpty()


def test_what_is_hidden_lets_the_keyboard_go(arranged: MainWindow, bench: Bench) -> None:
    arranged.activateWindow()
    words = arranged.parameters.filters.words
    words.setFocus()
    assert words.hasFocus()
    arranged._panels.put_away()
    assert arranged.focusWidget() is None or not arranged.focusWidget().hasFocus()


@pytest.mark.parametrize("page", [0, 1])
@pytest.mark.parametrize("wide", [120, 200, 300, 600])
def test_a_trial_can_be_decided_in_one_place_however_narrow_its_panel_is(
    arranged: MainWindow, bench: Bench, wide: int, page: int
) -> None:
    arranged.resizeDocks([arranged.docks[1]], [wide], Qt.Orientation.Horizontal)
    bench.station.writing.done(
        Written(7, {"gait.step_length": 0.4}, {"gait.step_length": 0.43}, trial_s=30.0)
    )
    arranged.tabs.setCurrentIndex(page)
    for _ in range(3):
        bench.draw(arranged)
    places = (arranged.parameters.trial, arranged.tabs.overview.now, arranged.trial)
    assert [one.can_be_decided for one in places].count(True) == 1
