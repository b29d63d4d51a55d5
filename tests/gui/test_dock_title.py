"""The title bar of the events: their filter stands in it, and goes back to them where there is none."""

from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QToolButton

from server_gui.views.frame.main_window import MainWindow
from tests.gui.fakes import Bench


def test_the_filter_of_the_events_is_in_their_title_bar_where_they_have_one(
    window: MainWindow, bench: Bench
) -> None:
    events, dock = window.events, window.docks[2]
    for width, in_title in ((1366, True), (1100, False), (1366, True)):
        window.resize(width, 768)
        bench.draw(window)
        dock.raise_()
        bench.draw(window)
        assert events.words.isVisible()
        assert events.isAncestorOf(events.words) is not in_title
        assert dock.isAncestorOf(events.words)
    rows = events.table.viewport().height() // events.table.verticalHeader().defaultSectionSize()
    assert rows >= 3, "two events are too few to see what happened"


def test_a_panel_floats_and_closes_by_the_buttons_of_its_title_bar(window: MainWindow, bench: Bench) -> None:
    dock = window.docks[2]
    bar = dock.titleBarWidget()
    assert bar is not None
    floats, closes = (one for one in bar.findChildren(QToolButton) if one.accessibleName())
    assert (floats.accessibleName(), closes.accessibleName()) == ("Float Events", "Close Events")
    QTest.mouseClick(floats, Qt.MouseButton.LeftButton)
    assert dock.isFloating()
    QTest.mouseClick(floats, Qt.MouseButton.LeftButton)
    assert not dock.isFloating()
    QTest.mouseClick(closes, Qt.MouseButton.LeftButton)
    assert dock.isHidden()
    dock.show()
    bench.draw(window)
    assert window.events.words.isVisible()
