"""While a stop is sent or held no place shows an enabled drive in green, nor the robot as stopped."""

import time

import pytest
from PySide6.QtWidgets import QApplication

from gateway.wire.stop import Stopped
from server_gui.views.frame.header import _drives, _outcome
from server_gui.views.overview.joint_cells import STATE, row_of
from server_gui.views.overview.now_line import _drives as overview_drives
from server_gui.views.robots.reset import _unstopped
from tests.gui.fakes import Around, Bench
from tests.support.desk import JOINTS, looked, telemetry, walking


@pytest.fixture(autouse=True)
def live(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy computer as well."""
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 60_000_000_000)


def _stopped(bench: Bench) -> None:
    bench.station.take([walking(100), looked()])
    bench.station.stop("STOP button of the window")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))


def _seen(bench: Bench, *enabled: str) -> None:
    """From now on these drives are enabled, and the others off."""
    at_ns = time.monotonic_ns() + 1_000_000_000
    columns: dict[str, list[float | None]] = {
        f"{joint}.state": [4.0 if joint in enabled else 6.0] for joint in JOINTS
    }
    bench.station.take([telemetry([at_ns], columns, at_ns)])


def test_a_drive_that_is_enabled_again_is_bad_in_every_place(around: Around, bench: Bench) -> None:
    _stopped(bench)
    _seen(bench, "left_knee")
    station, units = bench.station, bench.desk.shown.units
    outcome = _outcome(station)
    assert (outcome.mark.colour, outcome.main) == ("bad", "ENABLED AGAIN")
    assert outcome.parts == ("STOP again", "or use the hardware stop")
    assert outcome.tip.startswith("ENABLED AGAIN: left knee\n")
    assert _drives(station).mark.colour == "bad"
    mark, main, detail = overview_drives(station, units)
    assert (mark.colour, main) == ("bad", ("ENABLED AGAIN: STOP again", "ENABLED AGAIN"))
    assert detail[0] == "1 of 6 enabled · 1 of 6 enabled"
    assert row_of(station, "left_knee", bench.desk)[STATE].colour == "bad"
    bench.draw(around)
    QApplication.processEvents()
    assert around.header.outcome_text == "ENABLED AGAIN"
    card = around.robots.cards[0]
    assert "ENABLED AGAIN: left knee" in card.texts[1]
    assert not any("STOPPED" in text for text in card.texts)
    assert around.alarms.texts[0].startswith("ENABLED AGAIN: left knee")
    assert _unstopped(station).startswith(
        "ENABLED AGAIN: left knee. First STOP again, or use the hardware stop."
    )


def test_rows_from_before_the_answer_are_neither_green_nor_bad(bench: Bench) -> None:
    _stopped(bench)
    station, units = bench.station, bench.desk.shown.units
    assert _outcome(station).main == "STOP confirmed"
    assert _drives(station).mark.colour == "warn"
    assert overview_drives(station, units)[0].colour == "warn"
    assert row_of(station, "left_knee", bench.desk)[STATE].colour == "warn"


def test_a_stop_without_an_answer_is_said_of_each_robot_and_no_drive_is_green(
    around: Around, bench: Bench
) -> None:
    bench.station.take([walking(100), looked()])
    bench.station.stop("STOP button of the window")
    station, units = bench.station, bench.desk.shown.units
    bench.draw(around)
    QApplication.processEvents()
    assert around.robots.cards[0].texts[1] == "STOP sent"
    assert around.header.outcome_text == "STOP sent"
    for mark in (station.mark, _drives(station).mark, overview_drives(station, units)[0]):
        assert (mark.shape, mark.colour) == ("half", "warn")
    assert row_of(station, "left_knee", bench.desk)[STATE].colour == "warn"
