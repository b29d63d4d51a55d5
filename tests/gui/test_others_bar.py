"""The other robots stay in sight: their worst state and their STOP, where the list's cards are not."""

import time

import pytest
from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from gateway.client import ConnectionState, NotConnected
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import LinkChanged
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.robots.others_bar import OthersBar
from server_gui.views.theme import Theme
from tests.gui import rules
from tests.gui.fakes import Bench, stop_is_whole
from tests.support.desk import described, looked, walking

SCREENS = [(1024, 700), (1366, 768), (1920, 1080)]


def add(bench: Bench, number: int) -> Station:
    """Another robot, which walks."""
    station = bench.add(f"exo-{number:02}", 7420 + number)
    station.take([described(f"exo-{number:02}"), walking(300), looked()])
    return station


def in_fault(station: Station) -> None:
    station._watched_ns = 0
    station.take([looked(state="fault", problem="overcurrent, 0x2310")])


def settle(window: MainWindow, bench: Bench) -> None:
    """Let docks and bars find their places."""
    for _ in range(3):
        bench.draw(window)
        rules.settle()


def is_whole(widget: QWidget) -> bool:
    return widget.isVisible() and widget.visibleRegion().boundingRect() == widget.rect()


def is_in_sight(window: MainWindow, station: Station) -> bool:
    """Whether its worst state, in the words and the colour of its mark, and its own STOP are."""
    cards = [card for card in window.robots.cards if card.station is station and card.is_whole]
    if cards:
        return cards[0]._state.is_whole and cards[0].stop.is_whole
    found = [chip for chip in window.others.chips if chip.station is station and is_whole(chip)]
    if not found or not window.others.isVisible():
        return False
    (chip,) = found
    is_said = station.mark.word in chip.state._wordings and chip.state.is_whole
    return is_said and chip._icon._mark == station.mark and is_whole(chip.stop) and chip.stop.is_whole


def arrange(window: MainWindow, how: str) -> None:
    """Arrange the panels as people may."""
    robots, parameters = window.docks[:2]
    for dock in window.docks:
        dock.show()
    {
        "the list in front": robots.raise_,
        "the list behind": parameters.raise_,
        "the list closed": robots.hide,
        "all hidden": window._panels.put_away,
    }[how]()


@pytest.mark.parametrize("robots", [2, 4])
@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
@pytest.mark.parametrize(("width", "height"), SCREENS)
def test_every_robots_worst_state_and_its_stop_are_in_sight_however_panels_are_arranged(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float, robots: int
) -> None:
    bench.station.take([walking(300), looked()])
    others = [add(bench, number) for number in range(2, robots + 1)]
    in_fault(others[0])
    theme.set(scale=scale)
    window.resize(width, height)
    settle(window, bench)
    for how in ("the list in front", "the list behind", "the list closed", "all hidden"):
        arrange(window, how)
        settle(window, bench)
        unseen = [other.title for other in others if not is_in_sight(window, other)]
        assert not unseen, f"{how}: {unseen}"
        assert stop_is_whole(window), how
        assert not list(rules.cut_states(rules.seen(window))), how
        assert (window.width(), window.height()) == (width, height)


def test_a_large_window_that_shows_the_list_has_no_bar(window: MainWindow, bench: Bench) -> None:
    add(bench, 2)
    settle(window, bench)
    assert window.others.isHidden()
    window.docks[0].hide()
    settle(window, bench)
    assert [chip.station.title for chip in window.others.chips] == ["exo-01", "exo-02"]
    assert window.others.isVisible()
    window.docks[0].show()
    settle(window, bench)
    assert window.others.isHidden()


def test_a_list_that_floats_does_not_count_as_seen(window: MainWindow, bench: Bench) -> None:
    """It may be behind another panel, or beside the screen: Qt does not tell."""
    add(bench, 2)
    settle(window, bench)
    assert not window.stop_everyone.isVisible()
    window.docks[0].setFloating(True)
    settle(window, bench)
    assert not window.robots.shows_all
    assert window.others.isVisible()
    assert is_whole(window.stop_everyone)
    window.docks[0].setFloating(False)
    settle(window, bench)
    assert window.robots.shows_all
    assert window.others.isHidden()


def test_one_robot_alone_has_no_bar(window: MainWindow, bench: Bench) -> None:
    window.docks[0].hide()
    settle(window, bench)
    assert window.others.isHidden()


def test_a_chip_stops_its_robot_alone_and_a_click_leads_to_it(window: MainWindow, bench: Bench) -> None:
    other = add(bench, 2)
    window.docks[0].hide()
    settle(window, bench)
    _, chip = window.others.chips
    assert chip.stop.accessibleName() == "STOP exo-02"
    QTest.mousePress(chip.stop, Qt.MouseButton.LeftButton)
    assert [len(commands.named("stop")) for commands in bench.commands] == [0, 1]
    QTest.mouseClick(chip, Qt.MouseButton.LeftButton)
    assert bench.desk.selected is other
    settle(window, bench)
    assert [chip.property("selected") for chip in window.others.chips] == [False, True]
    bench.desk.remove(bench.station)
    settle(window, bench)
    assert window.others.isHidden()


def test_a_chip_says_what_the_card_says_of_a_stop_that_is_not_confirmed_and_of_what_is_not_known(
    window: MainWindow, bench: Bench
) -> None:
    other = add(bench, 2)
    window.docks[0].hide()
    other.stop("test")
    bench.commands[1].fail(NotConnected("there is no link"))
    settle(window, bench)
    (_, chip), card = window.others.chips, window.robots.cards[1]
    assert chip.state.shown.startswith("STILL MOVING"), "its drives are enabled"
    assert chip.state._wordings == card._state._wordings
    gone = add(bench, 3)
    gone.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    settle(window, bench)
    assert window.others.chips[2]._icon._mark.colour != "good"
    assert "no link" in window.others.chips[2].state._wordings


@pytest.fixture
def chips(window: MainWindow, bench: Bench) -> OthersBar:
    """Four robots beside each other, the first of which is looked at."""
    for number in range(2, 5):
        add(bench, number)
    window.docks[0].hide()
    settle(window, bench)
    window.activateWindow()
    QApplication.processEvents()
    return window.others


def test_no_robot_changes_its_place_when_another_one_is_looked_at(
    window: MainWindow, bench: Bench, chips: OthersBar
) -> None:
    """STOP exo-01 came under the pointer that had clicked on exo-02."""
    places = [chip.geometry() for chip in chips.chips]
    names = [chip.stop.accessibleName() for chip in chips.chips]
    assert names == ["STOP exo-01", "STOP exo-02", "STOP exo-03", "STOP exo-04"]
    for station in bench.desk.stations:
        bench.desk.select(station)
        settle(window, bench)
        assert [chip.geometry() for chip in chips.chips] == places
        assert [chip.stop.accessibleName() for chip in chips.chips] == names
        assert [chip.property("selected") for chip in chips.chips].count(True) == 1


def test_a_double_click_on_a_chip_looks_at_one_robot(
    window: MainWindow, bench: Bench, chips: OthersBar
) -> None:
    asked: list[str] = []
    for chip in chips.chips:
        chip.chosen.connect(lambda chip=chip: asked.append(chip.station.title))
    QTest.mouseClick(chips.chips[1], Qt.MouseButton.LeftButton)
    where = QPointF(chips.chips[2].rect().center())  # its place meanwhile, by some other change
    left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    second = QMouseEvent(QEvent.Type.MouseButtonDblClick, where, where, left, left, none)
    QApplication.sendEvent(chips.chips[2], second)
    assert asked == ["exo-02"]


def test_the_keyboard_stays_at_a_chips_stop_and_goes_to_no_other_with_it(
    window: MainWindow, bench: Bench, chips: OthersBar
) -> None:
    third = chips.chips[2]
    third.stop.setFocus()
    assert third.stop.hasFocus()
    add(bench, 5)
    settle(window, bench)
    assert third.stop.hasFocus()
    window.resize(1024, 700)  # fewer beside each other
    settle(window, bench)
    assert third.stop.hasFocus()
    bench.desk.select(third.station)
    settle(window, bench)
    assert third.stop.hasFocus()
    bench.desk.remove(third.station)
    settle(window, bench)
    assert QApplication.focusWidget() is None
    window.resize(1920, 1080)
    settle(window, bench)
    chips.chips[0].stop.setFocus()
    window.docks[0].show()
    settle(window, bench)
    assert chips.isHidden()
    assert QApplication.focusWidget() is None


def test_many_robots_on_a_small_screen_leave_two_thirds_to_the_rest(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    for number in range(2, 10):
        add(bench, number)
    theme.set(scale=2.0)
    window.resize(1024, 700)
    settle(window, bench)
    assert window.others.height() <= 700 // 3
    assert window.others.verticalScrollBar().maximum() > 0, "the rest is scrolled to"
    assert stop_is_whole(window)
    assert window.stop_everyone.isVisible()
