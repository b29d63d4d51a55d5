"""Pages that are not of a robot have the room of the parameters, unless somebody works at these."""

from collections.abc import Callable

import pytest
from PySide6.QtCore import Qt

from gateway.wire.parameter import Written
from server_gui.core.tuning.writing import WriteState
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench
from tests.support.desk import described, looked

PARAMETERS = 1  # among the docks


@pytest.fixture
def wide(full_window: MainWindow, bench: Bench) -> MainWindow:
    full_window.resize(1366, 768)
    bench.look_again([looked()])
    bench.draw(full_window)
    assert full_window.docks[PARAMETERS].isVisible()
    return full_window


def test_what_is_kept_has_their_room_and_they_come_back_as_wide_as_somebody_has_made_them(
    wide: MainWindow, bench: Bench
) -> None:
    parameters = wide.docks[PARAMETERS]
    wide.resizeDocks([parameters], [430], Qt.Orientation.Horizontal)
    bench.draw(wide)
    width, page = parameters.width(), wide.tabs.width()
    for _ in range(2):
        wide.tabs.look_at_recordings()
        bench.draw(wide)
        assert not parameters.isVisible()
        assert wide.tabs.width() > page + width
        assert all(dock.isVisible() for dock in wide.docks if dock is not parameters)
        wide.tabs.look_at(wide.tabs.overview)
        bench.draw(wide)
        assert (parameters.isVisible(), parameters.width()) == (True, width)


@pytest.mark.parametrize("begin", ["staged", "reviewed", "on trial", "not known"])
def test_what_is_worked_at_stays(wide: MainWindow, bench: Bench, begin: str) -> None:
    if begin == "not known":
        bench.station.writing.say(WriteState.UNKNOWN, "the link was lost")
    else:
        wide.parameters.stage_text("gait.step_length", "430")
    if begin == "reviewed":
        wide.parameters.begin_review()
        bench.station.edits.drop("gait.step_length")
    if begin == "on trial":
        bench.station.write(bench.station.difference(bench.desk.shown.units), trial_s=20.0)
        bench.first.answer(Written(7, {"gait.step_length": 0.4}, {"gait.step_length": 0.43}, trial_s=20.0))
        assert not bench.station.difference(bench.desk.shown.units)
    wide.tabs.look_at_recordings()
    bench.draw(wide)
    assert wide.docks[PARAMETERS].isVisible()


ASKS: dict[str, Callable[[MainWindow], object]] = {
    "by its name": lambda window: window.docks[PARAMETERS].toggleViewAction().trigger(),
    "to find one": lambda window: window._find(),
    "for all, by hiding the others first": lambda window: [
        press() for press in [window._panels.put_away] * 2
    ],
}


@pytest.mark.parametrize("ask", ASKS.values(), ids=ASKS)
def test_who_asks_for_them_meanwhile_sees_them(
    wide: MainWindow, bench: Bench, ask: Callable[[MainWindow], object]
) -> None:
    wide.tabs.look_at_recordings()
    ask(wide)
    bench.draw(wide)
    assert wide.docks[PARAMETERS].isVisible()
    wide.tabs.setCurrentIndex(wide.tabs.currentIndex() + 1)
    bench.draw(wide)
    wide.tabs.look_at(wide.tabs.overview)
    bench.draw(wide)
    assert all(dock.isVisible() for dock in wide.docks)


def test_what_somebody_has_hidden_stays_hidden(wide: MainWindow, bench: Bench) -> None:
    wide.docks[PARAMETERS].hide()
    wide.tabs.look_at_recordings()
    wide.tabs.look_at(wide.tabs.overview)
    bench.draw(wide)
    assert not wide.docks[PARAMETERS].isVisible()
    wide.tabs.look_at_recordings()
    wide._panels.put_away()  # the others
    wide.tabs.look_at(wide.tabs.overview)
    bench.draw(wide)
    assert not any(dock.isVisible() for dock in wide.docks)


def test_it_is_no_arrangement_of_anybody(wide: MainWindow, bench: Bench, theme: Theme) -> None:
    parameters = wide.docks[PARAMETERS]
    wide.tabs.look_at_recordings()
    bench.draw(wide)
    kept = wide._panels.state
    parameters.hide()
    wide._panels.restore(kept)
    assert not parameters.isHidden(), "it was kept as shown"
    wide.tabs.look_at(wide.tabs.overview)
    wide.tabs.look_at_recordings()
    theme.set(scale=1.5)
    bench.draw(wide)
    assert parameters in wide.tabifiedDockWidgets(wide.docks[0])
    theme.set(scale=1.0)
    bench.draw(wide)
    wide.tabs.look_at(wide.tabs.overview)
    bench.draw(wide)
    assert all(dock.isVisible() for dock in wide.docks)


def test_what_had_given_way_as_the_last_robot_went_comes_back_with_another(
    wide: MainWindow, bench: Bench
) -> None:
    wide.tabs.look_at_recordings()
    bench.draw(wide)
    bench.desk.remove(bench.station)
    bench.draw(wide)
    bench.add("exo-02", 7421).take([described("exo-02"), looked()])
    bench.draw(wide)
    assert not wide.docks[PARAMETERS].isVisible(), "the page has its room still"
    wide.tabs.look_at(wide.tabs.overview)
    bench.draw(wide)
    assert all(dock.isVisible() for dock in wide.docks)
