"""Where an event leads to: the signals of its robot at its instant."""

from types import SimpleNamespace

import pytest

from server_gui.core.follow.news import NewsKind
from server_gui.views.frame.main_window import MainWindow
from tests.gui.fakes import Bench
from tests.support.desk import walking


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
