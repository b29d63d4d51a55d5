"""The last line: that F12 is no emergency stop is never what gives way."""

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication

from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.commissioning.request import CommissioningRequest
from server_gui.core.commissioning.stages import Stage
from server_gui.views.frame.status_bar import StatusBar
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench, destroy
from tests.support.commissioning import FakeTalker


@pytest.fixture
def commissioning() -> Commissioning:
    return Commissioning(FakeTalker)


@pytest.fixture
def bar(theme: Theme, bench: Bench, commissioning: Commissioning) -> Iterator[StatusBar]:
    made = StatusBar(bench.desk, theme, commissioning)
    made.resize(1366, 24)
    made.show()
    yield made
    destroy(made)


@pytest.mark.parametrize("width", [1366, 1024, 800])
def test_it_says_not_an_emergency_stop_whatever_is_beside_it(
    bar: StatusBar, bench: Bench, width: int
) -> None:
    bar.resize(width, 24)
    for label in (bar.computer, bar.bus, bar.recording):
        label.say("CPU 100 % · memory 6 % · most: recorder 51 % of a core, and much more", "CPU 100 %")
    bar._hold_stop()
    QApplication.sendPostedEvents(None, QEvent.Type.LayoutRequest)
    assert "not an" in bar.stop.shown.replace("not a safety", "not an")
    assert bar.stop.is_whole


def test_it_says_which_robots_the_key_stops_while_one_is_commissioned(
    bar: StatusBar, bench: Bench, commissioning: Commissioning
) -> None:
    bar.refresh()
    assert "STOP" in bar.stop.text()
    commissioning.wish = CommissioningRequest("/home/ada/new-exo.toml", "can0")
    commissioning.stage = Stage.HAND
    bar.refresh()
    assert "stops exo-01 and new-exo" in bar.stop.shown
    assert "emergency stop" in bar.stop.shown
    commissioning.stage = Stage.STOPPED
    bar.refresh()
    assert "new-exo" not in bar.stop.shown
