"""A STOP that is not confirmed: what is to be done before why, and whether the robot moves still."""

import time

import pytest

from gateway.client import ConnectionState, NotConnected
from gateway.wire.stop import Stopped
from server_gui.core.alarms.texts import Kind
from server_gui.core.alarms.unconfirmed import remedy
from server_gui.core.follow.events import Event, LinkChanged
from tests.support.desk import JOINTS, Bench, kinds, telemetry, walking, walking_bench

ALL = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return walking_bench(monkeypatch)


def states(number: float, **others: float) -> Event:
    """A row, just now, with every drive in this state but these."""
    now_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {
        f"{joint}.state": [others.get(joint, number)] for joint in JOINTS
    }
    return telemetry([now_ns], columns, now_ns)


def _link_lost(bench: Bench) -> None:
    bench.station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])


def test_a_robot_that_moves_after_an_unconfirmed_stop_is_to_be_stopped_again(bench: Bench) -> None:
    _link_lost(bench)
    bench.station.stop("test")
    bench.first.fail(NotConnected("there is no link"))
    assert kinds(bench.station) == [Kind.NOT_STOPPED, Kind.NO_LINK]
    assert "MOVING" not in bench.station.alarms.active[0].alarm.line
    bench.station.take([LinkChanged(ConnectionState.CONNECTED, None, time.monotonic_ns()), walking(10)])
    (alarm,) = (one.alarm for one in bench.station.alarms.active)
    assert alarm.line.startswith("STILL MOVING: STOP again; the last STOP failed: there is no link")
    assert alarm.did == "all 6 drives enabled"
    assert bench.station.mark.word == "STILL MOVING"


def test_what_is_to_be_done_stands_before_why_a_stop_is_not_confirmed(bench: Bench) -> None:
    _link_lost(bench)
    bench.station.stop("test")
    bench.first.fail(NotConnected("nothing was sent; no gateway at 127.0.0.1:7420; is it running there?"))
    alarm = bench.station.alarms.active[0].alarm
    assert alarm.line == "STOP NOT CONFIRMED: use the hardware stop · no link, nothing was sent"
    assert alarm.why == "no gateway at 127.0.0.1:7420; is it running there?"


def test_where_only_a_controller_is_silent_the_drives_are_said_to_be_off_and_it_may_enable_them(
    bench: Bench,
) -> None:
    at_rest: dict[str, list[float | None]] = {f"{joint}.velocity": [0.0] for joint in JOINTS}
    bench.station.take([states(6.0), telemetry([time.monotonic_ns()], at_rest)])
    bench.station.stop("test")
    bench.first.answer(Stopped(ALL.drives, held=True, controllers={"gait": "unreachable"}))
    (one,) = bench.station.alarms.active
    said = "all 6 drives are off, the gait controller did not answer: it may enable them again"
    assert one.alarm.line == f"STOP NOT CONFIRMED: {said}"
    assert one.alarm.check.startswith("STOP again, keep the hardware stop at hand, check gait")
    assert remedy(bench.station.robot, bench.station.stopping)[0] == "STOP again"
    bench.station.take([states(4.0)])
    assert bench.station.mark.word == "STILL MOVING"
    bench.station.stop("again")
    bench.first.answer(Stopped({**ALL.drives, "left_knee": "unconfirmed"}, held=True))
    assert bench.station.stopping.silent == ()


@pytest.mark.parametrize(("age_s", "is_known"), [(2.0, True), (60.0, False)])
def test_a_drive_that_the_newest_row_shows_off_is_off_already_though_that_row_is_late(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, age_s: float, is_known: bool
) -> None:
    """Where the row was older than half a second, the STOP had a time of its own for it."""
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 500_000_000)
    columns: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    then_ns = time.monotonic_ns() - round(age_s * 1e9)
    bench.station.take([telemetry([then_ns], columns, then_ns)])
    bench.station.stop("test")
    bench.first.answer(ALL)
    assert bench.station.stopping.text.endswith("already off") is is_known


def test_a_stop_that_never_went_out_has_stopped_no_drive_that_was_off(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 60_000_000_000)
    bench.station.take([states(5.0, left_knee=4.0)])
    bench.station.stop("test")
    bench.first.fail(NotConnected("there is no link"))
    bench.station.take([states(5.0)])
    proofs = bench.station.stopping.proofs
    assert {joint for joint, proof in proofs.items() if not proof.was_so} == {"left_knee"}
    assert proofs["left_hip"].when == "already off"


def test_where_the_robots_file_cannot_be_used_nobody_says_that_all_drives_are_off(bench: Bench) -> None:
    """No STOP can be confirmed then: another one is no remedy."""
    bench.station.stop("test")
    outdated = "its file cannot be used: drives that it does not know may move"
    bench.first.answer(Stopped(ALL.drives, held=True, controllers={"gait": "unreachable"}, outdated=outdated))
    for number in (6.0, 4.0):
        at_rest: dict[str, list[float | None]] = {f"{joint}.velocity": [0.0] for joint in JOINTS}
        bench.station.take([states(number), telemetry([time.monotonic_ns()], at_rest)])
        (one,) = bench.station.alarms.active
        assert one.alarm.check == "use the hardware stop"
        assert "are off" not in one.alarm.line
        assert outdated in one.alarm.line
        assert not one.alarm.what.startswith("STOP again")
    assert bench.station.stopping.silent == ()
    bench.station.stop("again")
    bench.first.fail(NotConnected("there is no link"))
    assert remedy(bench.station.robot, bench.station.stopping)[0] == "STOP again"
