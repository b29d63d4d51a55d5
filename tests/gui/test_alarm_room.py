"""What has room in the strip of alarms, and what goes first where there is little."""

import time
from collections import defaultdict
from types import SimpleNamespace
from typing import cast

import pytest

from gateway.wire.stop import Stopped
from server_gui.core.commissioning.alarm import unstopped
from server_gui.core.commissioning.commissioning import Commissioning, Unconfirmed
from server_gui.core.commissioning.stages import LOOKS, Stage
from server_gui.views.alarms.words import REMEDY
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Theme
from tests.gui import rules
from tests.gui.fakes import Around, Bench
from tests.gui.faulty import CAUSE, fault, settle
from tests.support.desk import JOINTS, looked, walking


def test_the_list_of_alarms_is_no_higher_than_its_rows(window: MainWindow, bench: Bench) -> None:
    window.resize(1920, 1000)
    fault(bench)
    settle(window, bench)
    window.alarms.list.turn()
    settle(window, bench)
    assert window.alarms.list.height() < window.height() / 2
    assert rules.cut_words(window, [row.headline for row in window.alarms.list.rows]) == []


def test_how_to_go_on_after_a_stop_is_whole_before_it_is_said_who_has_stopped(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    """With large text it ended in an ellipsis, below a line about the address of this window."""
    theme.set(scale=1.5)
    window.resize(1024, 700)
    bench.station.take([walking(10), looked()])
    stopping = bench.station.stopping
    stopping.answered(stopping.sent(), Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    stopping.described(held=True, reason="STOP button of the window, by gwrms gui (127.0.0.1:46564)")
    bench.draw(window)
    assert "confirmed by all 6 drives" in window.alarms.headline.text()
    said = window.alarms.details.text()
    assert said.startswith("since ")
    assert said.endswith("then enable the drives: start the robot's controller again")


def test_what_to_check_has_room_before_the_register_of_a_code(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    theme.set(scale=1.5)
    window.resize(1024, 700)
    fault(bench)
    bench.draw(window)
    assert CAUSE.partition(" (")[0] in window.alarms.headline.text()
    said = window.alarms.details.text()
    assert said.startswith("since ")
    assert REMEDY in said


UNCONFIRMED = defaultdict(
    dict, {Stage.NOT_CONFIRMED: {"exo-09.toml": Unconfirmed("exo-09", "knee", time.time())}}
)


def commissioned(stage: Stage) -> Commissioning:
    """A robot at this stage."""
    known = SimpleNamespace(
        name="exo-09", look_of=LOOKS[stage], since_s=time.time(), unconfirmed=UNCONFIRMED[stage]
    )
    return cast("Commissioning", known)


def test_a_commissioned_robot_that_has_not_stopped_comes_before_another_ones_warning(
    around: Around, bench: Bench
) -> None:
    """A yellow line of the other one hid it."""
    bench.station.take([walking(300), looked(state="stale")])
    bench.desk.commissioned_alarms = lambda: unstopped(commissioned(Stage.NOT_CONFIRMED))
    settle(around, bench)
    assert around.alarms.headline.text() == "STOP NOT CONFIRMED: exo-09: knee"
    assert around.alarms.property("tone") == "urgent"
    around.alarms.acknowledge(around.alarms.told[0])
    settle(around, bench)
    assert any("exo-09" in text and "acknowledged" in text for text in around.alarms.texts)
    bench.desk.commissioned_alarms = lambda: unstopped(commissioned(Stage.STOPPED))
    settle(around, bench)
    assert not any("exo-09" in text for text in around.alarms.texts)


@pytest.mark.parametrize("stage", [Stage.STOPPED, Stage.NOT_CONFIRMED, Stage.MOVING])
def test_what_is_wrong_with_a_robot_that_is_commissioned_is_told_where_there_is_no_alarm(
    around: Around, bench: Bench, stage: Stage
) -> None:
    bench.station.take([walking(300), looked()])
    around.alarms.commissioned = lambda: commissioned(stage)
    settle(around, bench)
    assert around.alarms.headline.text() == f"exo-09 · {LOOKS[stage].mark.word}"
    assert around.alarms.property("tone") == LOOKS[stage].mark.colour
    assert around.alarms.details.text().startswith("since ")
    around.alarms.commissioned = lambda: commissioned(Stage.WORKING)
    settle(around, bench)
    assert "exo-09" not in around.alarms.headline.text()


def test_a_line_that_fits_without_a_scroll_bar_leaves_what_to_check_its_room(
    around: Around, bench: Bench, theme: Theme
) -> None:
    """What to check was cut while one of three lines stood empty."""
    theme.set(scale=1.5)
    around.resize(1500, 900)
    fault(bench)
    settle(around, bench)
    strip = around.alarms
    told = strip.told[0][1].alarm
    wide = strip.headline.fontMetrics().horizontalAdvance(told.line)
    for _ in range(3):
        around.resize(around.width() + wide + 6 - strip._words.maximumViewportSize().width(), 900)
        settle(around, bench)
    assert strip.headline.text() == told.line
    assert strip.details.text().startswith("since ")
    assert strip.details.text().endswith(told.check)


def test_a_scroll_bar_goes_with_the_words_that_needed_it(around: Around, bench: Bench, theme: Theme) -> None:
    """It takes the room by which what fits without it needs it: the second line was cut, and stayed so."""
    around.resize(1500, 900)
    fault(bench)
    settle(around, bench)
    strip, metrics = around.alarms, around.alarms.headline.fontMetrics()
    bar = strip._words.verticalScrollBar()
    whole, said = strip._words.room.width(), ""
    while metrics.horizontalAdvance(f"{said}m ") < whole:
        said += "m "
    strip._fit((said * 4,), ("",))
    rules.settle()
    assert bar.isVisible(), "nothing shorter is to be had"
    strip._fit((said.rstrip(),), ("since 10:00:00",))
    rules.settle()
    assert (strip.headline.text(), strip.details.text()) == (said.rstrip(), "since 10:00:00")
    assert not bar.isVisible()
