"""The last line: that F12 is no emergency stop is never what gives way."""

from collections.abc import Callable, Iterator

import pytest
from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication

from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.commissioning.request import CommissioningRequest
from server_gui.core.commissioning.stages import Stage
from server_gui.core.desk.recording import NO_FOLDER, Said, Tone
from server_gui.views.frame.status_bar import StatusBar
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench, destroy
from tests.gui.rules import settle
from tests.gui.test_rules import _fault, _just_begun, _stop_lost, _walks
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


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("state", [_just_begun, _walks, _fault, _stop_lost])
def test_what_the_key_is_not_goes_last_however_large_the_text_is(
    bar: StatusBar, bench: Bench, theme: Theme, state: Callable[[Bench], None], scale: float
) -> None:
    """It said `F12: software stop` alone on a small screen."""
    theme.set(scale=scale)
    bar.resize(1024, round(24 * scale))
    state(bench)
    bar.refresh()
    settle()
    assert "not an emergency stop" in bar.stop.shown or "not a safety" in bar.stop.shown
    for label in (bar.stop, bar.computer, bar.bus, bar.recording):
        assert label.is_whole, label.shown


def test_the_reason_why_nothing_is_recorded_is_in_the_last_line(
    bar: StatusBar, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = f"the spool /home/ada/gwrms/spool cannot be read: {NO_FOLDER}"
    said = Said(Tone.BAD, "NOT RECORDING", told, reason="its folder is missing")
    monkeypatch.setattr(bench.desk.recording, "said", lambda *_, **__: said)
    for width, words in ((1366, "NOT RECORDING · its folder is missing"), (1100, "NOT REC · its folder")):
        bar.resize(width, 24)
        bar.refresh()
        settle()
        assert bar.recording._wordings[-2 if width == 1366 else -1].startswith(words)
        assert "its folder is missing" in bar.recording.shown or NO_FOLDER in bar.recording.shown


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
