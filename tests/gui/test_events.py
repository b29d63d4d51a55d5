"""Events: which are shown, what stays above them, and where one leads to."""

from types import SimpleNamespace

import pytest

from gateway.wire.stop import Reset
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.news import NewsKind
from server_gui.views.frame.main_window import MainWindow
from tests.gui.fakes import Around, Bench
from tests.gui.faulty import CAUSE, fault
from tests.support.desk import described, looked, walking


def test_an_event_leads_to_its_instant_in_the_signals_that_are_shown(
    window: MainWindow, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    station, signals = bench.station, window.tabs.signals
    station.take([walking(400)])
    bench.desk.news.add(NewsKind.PARAMETER, station.title, "gait.step_length 400 → 430 mm")
    bench.desk.news.add(NewsKind.WARNING, "recording", "the disk is full")
    window.tabs.look_at(signals)
    bench.draw(window)
    before = signals.chosen
    window.tabs.setCurrentIndex(0)
    events = window.events
    (written,) = (place for place, line in enumerate(events.lines) if "430 mm" in line.text)
    (disk,) = (place for place, line in enumerate(events.lines) if "disk" in line.text)
    written_s = events.lines[written].utc_s or 0.0
    two_later = SimpleNamespace(time=lambda: written_s + (station.robot.age_s() or 0.0) + 2.0)
    monkeypatch.setattr("server_gui.views.alarms.events_panel.time", two_later)
    events.table.activated.emit(events.table.model().index(disk, 0))
    assert window.tabs.currentIndex() == 0, "it is of no robot"
    events.table.activated.emit(events.table.model().index(written, 0))
    assert window.tabs.currentIndex() == 1
    assert signals.pause.isChecked(), "the instant runs away"
    assert signals.chosen == before
    left, right = signals.plots[0].plot.window_s
    assert left <= -2.0 <= right


def test_how_often_something_came_stands_before_what_may_have_no_room(around: Around, bench: Bench) -> None:
    for change in ("off → on", "on → off", "off → on"):
        bench.desk.news.add(NewsKind.STATE, bench.station.name, f"all 6 drives: {change}")
    bench.draw(around)
    (line,) = (line for line in around.events.lines if "off → on" in line.text)
    assert line.text.startswith("2 times since ")
    assert line.text.endswith(": all 6 drives: off → on")


def test_an_active_alarm_stays_above_whatever_else_happens_and_is_chosen(
    around: Around, bench: Bench
) -> None:
    fault(bench)
    for number in range(600):
        bench.desk.news.add(NewsKind.STALE, "exo-01", f"right_insole {number} stale")
    around.events.words.setText("nothing that there is")
    bench.draw(around)
    assert around.events.lines == around.events.pinned
    assert f"left knee: {CAUSE}" in [line.text for line in around.events.lines]


def test_the_worst_alarm_is_the_first_event_also_if_it_is_the_recording_s(
    around: Around, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.station.take([walking(100), looked(state="stale", problem="nothing for 2 s")])
    bad = Alarm(Kind.NOT_RECORDED, "", "the disk of the spool is full")
    monkeypatch.setattr(bench.desk.recording, "_found", lambda: iter([bad]))
    bench.draw(around)
    colours = [line.mark.colour for line in around.events.pinned]
    assert (around.events.pinned[0].robot, colours[:2]) == ("recording", ["bad", "warn"])


def test_a_robot_s_alarm_that_is_worse_than_the_recording_s_is_before_it(
    around: Around, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault(bench)
    late = Alarm(Kind.UPLOAD, "", "the store is not reached")
    monkeypatch.setattr(bench.desk.recording, "_found", lambda: iter([late]))
    bench.draw(around)
    told = [(line.robot, line.mark.word) for line in around.events.pinned]
    assert told[0] == (bench.station.title, "fault")
    assert told[-1] == ("recording", "store")


def test_events_are_chosen_by_kind_and_word(around: Around, bench: Bench) -> None:
    bench.desk.news.add(NewsKind.STALE, "exo-01", "right_insole stale")
    bench.desk.news.add(NewsKind.STOP, "exo-01", "STOP confirmed")
    bench.draw(around)
    around.events.kinds.setCurrentText("Faults and stops")
    assert [line.text for line in around.events.lines[len(around.events.pinned) :]] == ["STOP confirmed"]
    around.events.kinds.setCurrentText("Everything")
    around.events.words.setText("insole")
    assert [line.text for line in around.events.lines[len(around.events.pinned) :]] == ["right_insole stale"]


def test_events_of_the_only_robot_do_not_spend_their_room_on_its_name(around: Around, bench: Bench) -> None:
    def said(row: int = 0) -> object:
        return around.events.table.model().index(row, 3).data()

    while len(bench.desk.stations) > 1:
        bench.desk.remove(bench.desk.stations[-1])
    bench.desk.news.add(NewsKind.WARNING, "recording", "the disk is full")
    bench.desk.news.add(NewsKind.STOP, bench.desk.stations[0].title, "STOP confirmed")
    bench.draw(around)
    first = len(around.events.pinned)
    assert around.events.table.isColumnHidden(2)
    assert (said(first), said(first + 1)) == ("STOP confirmed", "recording: the disk is full")
    bench.add("exo-02")
    bench.draw(around)
    assert not around.events.table.isColumnHidden(2)
    assert said(len(around.events.pinned) + 1) != "recording: the disk is full"


def test_what_a_robot_did_before_it_said_its_name_stands_under_that_name(
    around: Around, bench: Bench
) -> None:
    """It stood under an address: two robots seemed to be three."""
    other = bench.add("127.0.0.1-7421", 7421)
    other.tell(NewsKind.LINK, "reached at last")
    other.take([described("simulated-exo")])
    bench.draw(around)
    assert {line.robot for line in around.events.lines if "at last" in line.text} == {"simulated-exo"}
    bench.desk.remove(other)
    bench.draw(around)
    assert {line.robot for line in around.events.lines if "at last" in line.text} == {"simulated-exo"}


def test_what_one_robot_did_stays_its_own_when_another_one_answers_at_its_address(
    around: Around, bench: Bench
) -> None:
    other = bench.add("127.0.0.1-7421", 7421)
    other.take([described("exo-01")])
    other.tell(NewsKind.STOP, "STOP NOT CONFIRMED: no link")
    other.take([described("exo-02")])
    bench.draw(around)
    (line,) = (one for one in around.events.lines if "STOP NOT" in one.text)
    assert line.robot.startswith("exo-01")


def test_each_stop_is_an_event_of_its_own(around: Around, bench: Bench) -> None:
    for _ in range(2):
        bench.station.tell(NewsKind.STOP, "STOP confirmed by all 6 drives")
    bench.draw(around)
    assert [one.text for one in around.events.lines].count("STOP confirmed by all 6 drives") == 2


def test_active_alarms_stand_in_the_order_of_the_alarms_above_the_pages(around: Around, bench: Bench) -> None:
    other = bench.add("exo-02", 7421)
    other.take([described("exo-02")])
    for station in (other, bench.station):
        station.take([walking(100), looked(state="stale", problem="nothing for 2 s")])
    bench.draw(around)
    for selected in bench.desk.stations:
        bench.desk.select(selected)
        bench.draw(around)
        strip = [station.title for station, _ in around.alarms.told if station is not None]
        assert [line.robot for line in around.events.pinned] == strip
        assert strip[0] == selected.title


def test_a_reset_is_an_event_of_its_own_and_no_warning(around: Around, bench: Bench) -> None:
    bench.station.reset()
    bench.first.answer(Reset({}, {}, held=False))
    bench.draw(around)
    (line,) = (line for line in around.events.lines if "faults cleared" in line.text)
    assert (line.mark.shape, line.mark.colour, line.mark.word) == ("ring", "dim", "RESET")


def test_only_whole_rows_of_events_are_shown(around: Around, bench: Bench) -> None:
    for number in range(20):
        bench.desk.news.add(NewsKind.CONTROL, "exo-01", f"deed {number}")
    for high in (150, 163, 171, 188):
        around.events.setFixedHeight(high)
        bench.draw(around)
        row = around.events.table.verticalHeader().defaultSectionSize()
        assert around.events.table.viewport().height() % row == 0
