"""The window as a whole: first run, robots, looks, sizes, layout, words that are always there."""

import re
import time

import pytest
from PySide6.QtCore import QSize, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QLineEdit, QTabBar, QWidget

from gateway.client import ConnectionState, NotConnected
from server_gui.core.follow.events import LinkChanged
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.frame.on_screen import USUAL, opening_size
from server_gui.views.parameters.tree import DEFAULT, RANGE
from server_gui.views.robots.panel import RobotsPanel
from server_gui.views.theme import PALETTES, Look, Theme
from tests.gui.fakes import Around, Bench, destroy, make_every_page, stop_is_whole
from tests.support.desk import described, looked, walking

TEXT = ("text", "dim", "accent", "left", "right", "good", "warn", "bad")


def test_a_robot_that_is_gone_says_so_and_how_old_its_data_are(around: Around, bench: Bench) -> None:
    bench.station.take([walking(50, age_s=70.0)])
    why = "nothing came from 127.0.0.1:7420 for 3.0 s; the link is given up"
    bench.look_again([LinkChanged(ConnectionState.WAITING, why, time.monotonic_ns())])
    bench.draw(around)
    card = around.robots.cards[0]
    assert card.texts[:2] == ("exo-01", f"no link: {why}")
    assert re.fullmatch(r"7\d\.\d s old", card.texts[2])
    assert f"no link: {why}" in bench.desk.news.items[0].text


def test_two_robots_of_one_name_are_told_apart(theme: Theme, bench: Bench) -> None:
    bench.add("other", 7421).take([described("exo-01")])
    panel = RobotsPanel(bench.desk, theme)
    panel.refresh()
    assert [card.texts[0] for card in panel.cards] == ["exo-01 at 127.0.0.1:7420", "exo-01 at 127.0.0.1:7421"]


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("host:port", "is not a robot's address"),
        ("127.0.0.1:7420", "is in the list already"),
        ("my exo=192.0.2.7", "is not a name"),
        ("exo-01=192.0.2.7", "give it another name"),
    ],
)
def test_an_address_that_cannot_be_added_says_why(theme: Theme, bench: Bench, typed: str, said: str) -> None:
    panel = RobotsPanel(bench.desk, theme)
    added: list[str] = []
    panel.added.connect(added.append)
    panel.address.setText(typed)
    QTest.keyClick(panel.address, Qt.Key.Key_Return)
    assert added == []
    assert said in panel.said.text()


def test_an_address_is_added(theme: Theme, bench: Bench) -> None:
    panel = RobotsPanel(bench.desk, theme)
    added: list[str] = []
    panel.added.connect(added.append)
    for typed in (" 192.0.2.7 ", "left=192.0.2.8"):
        panel.address.setText(typed)
        QTest.keyClick(panel.address, Qt.Key.Key_Return)
    assert added == ["192.0.2.7:7420", "left=192.0.2.8:7420"]


def test_the_same_news_twice_in_a_row_are_told_once(bench: Bench) -> None:
    for _ in range(3):
        bench.look_again([looked(state="lost", problem="no heartbeat")])
    assert [item.text for item in bench.desk.news.items].count("left knee lost: no heartbeat") == 1


def test_the_layout_is_kept_and_can_be_reset(window: MainWindow, bench: Bench, theme: Theme) -> None:
    events = window.docks[2]
    events.hide()
    window.close()
    again = MainWindow(bench.desk, theme, window.kept)
    again.resize(USUAL)
    again.show()
    assert again.docks[2].isHidden()
    again.reset_layout()
    assert not again.docks[2].isHidden()
    destroy(again)


@pytest.mark.parametrize(("width", "height", "scale"), [(1366, 768, 1.0), (1920, 1080, 2.0)])
def test_the_window_fits_the_screen_with_stop_whole_and_in_sight(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    """Smaller text and larger screens are in `test_screens`."""
    bench.station.take([walking(100), looked()])
    theme.set(scale=scale)
    window.resize(width, height)
    bench.draw(window)
    assert (window.width(), window.height()) == (width, height)
    assert stop_is_whole(window)


@pytest.mark.parametrize("look", Look)
@pytest.mark.parametrize("name", TEXT)
def test_every_text_can_be_read_on_its_ground(look: Look, name: str) -> None:
    colours = PALETTES[look]
    for ground in ("card", "panel", "window"):
        assert contrast(getattr(colours, name), getattr(colours, ground)) >= 4.5


def test_left_and_right_are_told_apart_by_those_who_see_no_red_or_green() -> None:
    for colours in PALETTES.values():
        blue = [int(getattr(colours, side)[5:7], 16) for side in ("left", "right")]
        assert abs(blue[0] - blue[1]) > 150


def test_everything_that_can_be_reached_has_a_name(window: MainWindow) -> None:
    make_every_page(window)
    nameless = [
        f"{type(widget).__name__} {widget.objectName()}"
        for widget in window.findChildren(QWidget)
        if isinstance(widget, QAbstractButton | QLineEdit)
        and widget.focusPolicy() & Qt.FocusPolicy.TabFocus
        and not (widget.accessibleName() or (isinstance(widget, QAbstractButton) and widget.text()))
        and widget.objectName() not in ("qt_spinbox_lineedit",)
    ]
    assert nameless == []


def contrast(one: str, other: str) -> float:
    """WCAG 2.2: the ratio of two colours' relative luminances."""
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def luminance(colour: str) -> float:
    parts = [int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_a_window_without_room_has_its_panels_behind_each_other_and_gives_them_back(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    window.setUpdatesEnabled(True)  # its layouts come to rest as it is painted
    window.resize(1366, 768)
    bench.draw(window)
    before = [dock.geometry() for dock in window.docks]
    theme.set(scale=1.5)
    bench.draw(window)
    assert (window.width(), window.height()) == (1366, 768)
    robots, parameters, events = window.docks
    assert set(window.tabifiedDockWidgets(robots)) == {parameters, events}
    parameters.raise_()
    bench.draw(window)
    assert window.tabs.overview.width() > 600
    assert not window.parameters.visibleRegion().isEmpty()
    assert stop_is_whole(window)
    QTest.mouseClick(window.panels_button, Qt.MouseButton.LeftButton)
    bench.draw(window)
    assert window.tabs.overview.width() > 1300
    assert stop_is_whole(window)
    QTest.mouseClick(window.panels_button, Qt.MouseButton.LeftButton)
    theme.set(scale=1.0)
    bench.draw(window)
    assert [dock.geometry() for dock in window.docks] == before
    assert not window.panels_button.isVisible()
    bars = window.findChildren(QTabBar, options=Qt.FindChildOption.FindDirectChildrenOnly)
    assert not any(bar.isVisible() for bar in bars), "names of panels are left over the pages"
    tree = window.parameters.tree
    bench.draw(window)
    assert not any(tree.isColumnHidden(column) for column in (RANGE, DEFAULT))


def test_a_tight_window_begins_with_the_robot_and_has_its_panels_a_click_away(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    window.resize(1024, 700)
    theme.set(scale=1.5)
    bench.draw(window)
    assert window.tabs.overview.width() > 1000
    assert window.tabs.overview._columns == 3
    assert not any(dock.isVisible() for dock in window.docks)
    QTest.mouseClick(window.panels_button, Qt.MouseButton.LeftButton)
    bench.draw(window)
    assert set(window.tabifiedDockWidgets(window.docks[0])) == set(window.docks[1:])
    QTest.mouseClick(window.panels_button, Qt.MouseButton.LeftButton)
    QTest.keyClick(window, Qt.Key.Key_F, Qt.KeyboardModifier.ControlModifier)
    bench.draw(window)
    assert not window.parameters.visibleRegion().isEmpty()
    for button in (window.parameters.review_button, window.parameters.more):
        assert button.visibleRegion().boundingRect() == button.rect(), "it is below the edge"
    bench.look_again([looked()])
    window.parameters.stage_text("gait.step_length", "430")
    window.parameters.begin_review()
    bench.draw(window)
    review = window.parameters.review
    for control in (review.try_it, review.seconds, review.write_it):
        assert control.visibleRegion().boundingRect() == control.rect(), "it is below the edge"
    assert set(window.tabifiedDockWidgets(window.docks[1])) == {window.docks[0], window.docks[2]}
    window._panels.put_away()
    theme.set(scale=1.0)
    bench.draw(window)
    assert all(dock.isVisible() for dock in window.docks)


@pytest.mark.parametrize(
    ("width", "height", "scale"), [(1366, 768, 1.0), (1024, 700, 1.0), (1024, 700, 2.0), (1920, 1080, 2.0)]
)
def test_every_page_is_in_sight_by_its_name(
    full_window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    bar = full_window.page_bar
    theme.set(scale=scale)
    full_window.resize(width, height)
    bench.draw(full_window)
    for button in (*bar.buttons, full_window.help_button):
        assert button.width() >= button.sizeHint().width()
        assert button.visibleRegion().boundingRect() == button.rect(), button.text()
    assert stop_is_whole(full_window)
    for place, button in enumerate(bar.buttons):
        QTest.mouseClick(button, Qt.MouseButton.LeftButton)
        assert full_window.tabs.currentIndex() == place
        assert [one.isChecked() for one in bar.buttons].index(True) == place


def test_in_a_window_without_room_seldom_things_are_behind_one_button(
    window: MainWindow, bench: Bench
) -> None:
    window.resize(900, 700)
    bench.look_again([looked()])
    bench.draw(window)
    panel = window.parameters
    panel.tree.select_name("gait.step_length")
    menu = panel.more.menu()
    menu.aboutToShow.emit()
    actions = {action.text(): action for action in menu.actions()}
    assert all(action.isEnabled() for action in actions.values())
    actions["Store to flash …"].trigger()
    assert panel.storing.isVisible()


@pytest.mark.parametrize(("width", "height", "scale"), [(1100, 700, 1.0), (1366, 768, 2.0)])
def test_what_became_of_a_stop_is_read_in_full_in_a_small_window(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    theme.set(scale=scale)
    window.resize(width, height)
    bench.station.stop("test")
    bench.first.fail(NotConnected("no link"))
    bench.station.stopping.held = True
    bench.draw(window)
    words = window.header._outcome._main
    assert words.text() == "STOP NOT CONFIRMED"
    assert words.fontMetrics().horizontalAdvance(words.text()) <= words.width()
    assert window.header.reset_button.isVisible()
    assert (window.width(), window.height()) == (width, height)
    assert stop_is_whole(window)


def test_a_window_with_large_text_opens_as_large_as_its_screen() -> None:
    assert opening_size(QSize(1920, 1080), 1.5) == QSize(1920, 1080)
    assert opening_size(QSize(3840, 2160), 1.5) == USUAL * 1.5
    assert opening_size(QSize(3840, 2160), 0.8) == USUAL
    assert opening_size(QSize(1024, 700), 1.0) == QSize(1024, 700)
