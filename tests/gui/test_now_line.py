"""The overview's first line: what is so now, since when, and what is on trial."""

import itertools
import time

import pytest
from PySide6.QtWidgets import QWidget

from gateway.client import ConnectionState
from gateway.wire.component import QualityInfo, Snapshot
from gateway.wire.stop import Stopped
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.events import LinkChanged, Looked
from server_gui.core.tuning.writing import Trial
from server_gui.views.frame.header import _drives as header_drives
from server_gui.views.marks import time_of_day
from server_gui.views.overview.now_line import NowLine
from server_gui.views.overview.page import Overview
from server_gui.views.predictions import doing
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench, destroy
from tests.gui.rules import settle
from tests.gui.test_rules import _just_begun, _stop_lost, _walks
from tests.support.desk import JOINTS, looked, telemetry, walking


def test_a_trial_is_kept_or_taken_back_where_it_is_seen(overview: Overview, bench: Bench) -> None:
    overview.refresh()
    assert not overview.now.trial.isVisible()
    until_ns = time.monotonic_ns() + 24 * 10**9
    trial = Trial(7, {"gait.step_length": 0.42}, {"gait.step_length": 0.4}, until_ns)
    bench.station.writing.trial = trial
    overview.read_now()
    overview.refresh()
    assert overview.now.trial.isVisible()
    assert overview.now.trial.main.text() == "On trial: step length (gait) 400 → 420 mm"
    assert overview.now.keep.objectName() != "primary", "nobody knows yet what it does"
    assert overview.now.trial.detail.text().startswith("taken back in ")
    asked: list[object] = []
    overview.now.compare.connect(asked.append)
    overview.now.ab.click()
    assert asked == [bench.station]
    overview.now.keep.click()
    overview.now.take_back.click()
    assert bench.first.named("confirm") == [(7,)]
    assert bench.first.named("revert") == [(7,)]


@pytest.mark.parametrize("others", [0, 2])
def test_a_trial_is_never_shown_without_its_value(theme: Theme, bench: Bench, others: int) -> None:
    names = ["gait.step_length", "left_knee.max_torque", "right_knee.max_torque"][: 1 + others]
    until_ns = time.monotonic_ns() + 24 * 10**9
    trial = Trial(7, dict.fromkeys(names, 0.42), dict.fromkeys(names, 0.4), until_ns)
    bench.station.writing.trial = trial
    now = NowLine(bench.desk, theme)
    now.show()
    for scale in (1.0, 1.5):
        theme.set(scale=scale)
        for width, is_offered in itertools.product(range(220, 1060, 60), (True, False)):
            now.offer(is_offered)
            now.resize(round(width * scale), 200)
            now.refresh()
            settle()
            shown, end = now.trial.main, now.trial.detail
            assert "400 → 420" in shown.shown or f"{1 + others} values" in shown.shown, (width, scale)
            assert shown.is_whole, (width, scale, shown.shown)
            assert end.is_whole, (width, scale, end.shown)
            assert now.keep.isVisible() is is_offered
    assert now.trial.main.shown.startswith("On trial: step length (gait) 400 → 420 mm")
    destroy(now)


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
def test_the_words_of_a_state_are_whole_in_one_line_too(theme: Theme, bench: Bench, scale: float) -> None:
    """It said `STOP NO…NFIRMED` beside `Activity not known`."""
    theme.set(scale=scale)
    around = QWidget()  # else its own layout keeps it from being narrow
    now = NowLine(bench.desk, theme)
    now.setParent(around)
    now.be_flat(True)
    around.show()
    cut = []
    for state, width in itertools.product((_just_begun, _walks, _stop_lost), range(300, 1060, 20)):
        if width == 300:
            bench.desk.select(bench.desk.stations[0])
            state(bench)
        now.resize(round(width * scale), 40)
        now.refresh()
        settle()
        for fact in (now.drives, now.activity):
            cut += [(width, one.shown) for one in (fact.main, fact.detail) if not one.is_whole]
    assert not cut
    assert "enabled" in now.drives.detail.shown, "where there is room"
    destroy(around)


def test_a_held_stop_says_since_when_and_that_every_drive_has_confirmed_it(
    overview: Overview, bench: Bench
) -> None:
    received_ns = time.monotonic_ns()
    states: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    bench.station.take([walking(10), looked(), telemetry([received_ns], states, received_ns)])
    stopping = bench.station.stopping
    stopping.answered(stopping.sent(), Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    stopping.answered_ms = 21.0
    overview.read_now()
    overview.refresh()
    assert overview.now.drives.main.text() == f"STOPPED since {time_of_day(stopping.since_s or 0.0)}"
    assert overview.now.drives.detail.text() == "6/6 confirmed in 21 ms"


@pytest.mark.parametrize("linked", [True, False])
def test_a_held_stop_stays_in_headline_and_card_while_no_data_comes(
    overview: Overview, bench: Bench, linked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It said Drives not known, half a second after the last row."""
    now_ns = time.monotonic_ns()
    states: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    station = bench.station
    station.take([walking(10), looked(), telemetry([now_ns], states, now_ns)])
    station.stopping.answered(station.stopping.sent(), Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    station.stopping.answered_ms = 1498.0
    if not linked:
        station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 0)
    assert not station.is_live
    overview.read_now()
    overview.refresh()
    drives = overview.now.drives
    since = f"STOPPED since {time_of_day(station.stopping.since_s or 0.0)}"
    assert drives.main._wordings[0] == (since if linked else f"{since}, as far as is known")
    assert drives._icon._mark.colour == "warn"
    assert drives.detail._wordings[0].startswith("6/6 confirmed in 1498 ms · no data for 0.")
    assert doing(station)[0].startswith("STOPPED" if linked else "STOPPED, as far as is known")
    assert "no data for 0." in doing(station)[0]
    assert all(words.startswith("STOPPED") for words in doing(station)), "also where there is little room"
    assert header_drives(station).main == "Off when last seen"


def test_a_held_stop_is_on_the_card_beside_another_trouble(bench: Bench) -> None:
    """Beside a full bus the card said *0 of 6 enabled* alone."""
    now_ns = time.monotonic_ns()
    states: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    station = bench.station
    bench.look_again([walking(10), looked(), telemetry([now_ns], states, now_ns)])
    station.stopping.answered(station.stopping.sent(), Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    assert doing(station)[0] == "0 of 6 enabled", "the line above says STOPPED"
    lost = {"left_insole": QualityInfo(state="lost", age_ms=900.0, problem="it does not answer")}
    bench.look_again([Looked(Snapshot(0, {}, {}, lost), looked().parameters, time.monotonic_ns())])
    assert station.alarms.worst is not None
    assert station.alarms.worst.kind is Kind.LOST
    assert doing(station) == ("STOPPED · 0 of 6 enabled", "STOPPED · 0/6 enabled", "STOPPED")


def test_drives_that_were_enabled_when_data_ended_are_not_called_stopped(
    overview: Overview, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_ns = time.monotonic_ns()
    states: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    states["left_knee.state"] = [4.0]
    bench.station.take([walking(10), looked(), telemetry([now_ns], states, now_ns)])
    bench.station.stopping.described(True, "by somebody")
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 0)
    overview.read_now()
    overview.refresh()
    assert overview.now.drives.main.text() == "Drives not known"


def test_a_stop_that_is_not_confirmed_leads_the_overview(overview: Overview, bench: Bench) -> None:
    """It said Operation enabled, in large letters."""
    bench.station.take([walking(10), looked()])
    stopping = bench.station.stopping
    stopping.failed(stopping.sent(), "no link")
    overview.read_now()
    overview.refresh()
    drives = overview.now.drives
    assert (drives.main.text(), drives._icon._mark.colour) == ("STILL MOVING: STOP again", "bad")
    assert drives.detail.text() == "operation enabled · 6 of 6 enabled"


def test_the_first_line_says_which_drive_is_the_warmest(overview: Overview, bench: Bench) -> None:
    received_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {f"{joint}.temperature": [40.0] for joint in JOINTS}
    columns["right_knee.temperature"] = [61.4]
    columns["left_hip.temperature"] = [None]
    bench.station.take([walking(10), looked(), telemetry([received_ns], columns, received_ns)])
    overview.read_now()
    overview.refresh()
    said = overview.now.drives.detail._wordings
    assert said[0].endswith(" of 6 enabled · warmest: right knee 61 °C")
    assert said[-1].endswith(" of 6 enabled"), "where that has no room"
