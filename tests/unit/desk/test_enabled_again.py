"""A drive that is enabled while a stop is held has not stayed stopped, and nothing says that it has."""

import time
from collections.abc import Callable

import pytest

from gateway.client import ConnectionState
from gateway.wire.stop import Reset, Stopped
from server_gui.core.alarms.marks import drives_mark
from server_gui.core.alarms.texts import UNSTOPPED, Kind
from server_gui.core.alarms.unconfirmed import enabled_again, enabled_mark, remedy
from server_gui.core.alarms.undriven import HELD, undriven
from server_gui.core.alarms.worst_state import STOP_SENT
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import Event, LinkChanged
from server_gui.core.tuning.stop import StopProgress, StopState
from tests.support.desk import JOINTS, Bench, kinds, looked, telemetry, walking, walking_bench

ALL = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)
OFF = Reset(dict.fromkeys(JOINTS, "switch on disabled"), {}, held=False)
HOUR_NS = 3_600_000_000_000  # so that rows are new however slow a test is
HEARD = {"n": 9, "what": "stop", "reason": "fell", "who": "ann"}


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return walking_bench(monkeypatch)


def states(number: float | None, **others: float | None) -> Event:
    """A row, an hour from now, with every drive in this state but these."""
    at_ns = time.monotonic_ns() + HOUR_NS
    columns = {f"{joint}.state": [others.get(joint, number)] for joint in JOINTS}
    return telemetry([at_ns], columns, at_ns)


def drives(station: Station) -> tuple[str, str]:
    mark = drives_mark(station.robot, enabled_mark(station.robot, station.stopping))
    return mark.colour, mark.word


def ours(bench: Bench) -> None:
    bench.station.stop("test")
    bench.first.answer(ALL)


def others(bench: Bench) -> None:
    bench.station.stopping.read([HEARD])


def told_with_the_link(bench: Bench) -> None:
    bench.station.stopping.described(held=True, reason="fell")


STOPS = pytest.mark.parametrize("stop", [ours, others, told_with_the_link])


@STOPS
def test_drives_that_are_enabled_while_a_stop_is_held_are_an_alarm_that_names_them(
    bench: Bench, stop: Callable[[Bench], None]
) -> None:
    """It was STOPPED, with a green mark beside it."""
    stop(bench)
    station = bench.station
    station.take([states(6.0)])
    assert kinds(station) == [Kind.STOPPED]
    station.take([states(6.0, left_knee=4.0, right_hip=4.0)])
    (one,) = station.alarms.active
    assert one.alarm.kind is Kind.ENABLED_AGAIN
    assert one.alarm.kind in UNSTOPPED
    assert one.alarm.what == "left knee, right hip"
    assert one.alarm.check == "STOP again, or use the hardware stop"
    assert (station.mark.colour, station.mark.word) == ("bad", "ENABLED AGAIN")
    assert drives(station) == ("bad", "2 of 6 enabled")
    assert undriven(station.robot, station.stopping) == ""
    station.take([states(4.0)])
    assert station.alarms.active[0].alarm.what == "all 6 drives"
    assert drives(station) == ("bad", "operation enabled")
    station.stopping.described(held=True, reason="fell")
    assert kinds(station) == [Kind.ENABLED_AGAIN], "it was held before"
    station.take([states(6.0)])
    assert kinds(station) == [Kind.STOPPED]
    assert undriven(station.robot, station.stopping) == HELD


@STOPS
def test_rows_from_before_it_was_known_that_a_stop_is_held_raise_nothing_and_are_not_green(
    bench: Bench, stop: Callable[[Bench], None]
) -> None:
    stop(bench)
    assert kinds(bench.station) == [Kind.STOPPED]
    assert bench.station.mark.word == "STOPPED"
    assert drives(bench.station) == ("warn", "operation enabled")


@pytest.mark.parametrize("other", [5.0, None])
def test_what_the_other_drives_do_does_not_hide_one_that_is_enabled_again(
    bench: Bench, other: float | None
) -> None:
    ours(bench)
    bench.station.take([states(other, left_knee=4.0)])
    assert bench.station.alarms.active[0].alarm.what == "left knee"
    assert drives(bench.station) == ("bad", "1 of 6 enabled")


def test_without_live_rows_nobody_says_that_they_are_enabled_again(bench: Bench) -> None:
    ours(bench)
    bench.station.take([states(4.0)])
    bench.station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    assert Kind.ENABLED_AGAIN not in kinds(bench.station)
    assert kinds(bench.station)[0] is Kind.NO_LINK


def test_a_reset_by_anybody_ends_it_and_enabling_then_is_no_alarm(bench: Bench) -> None:
    ours(bench)
    bench.station.take([states(6.0)])
    bench.station.stopping.read([HEARD])
    bench.station.stopping.read([{"n": 10, "what": "reset", "held": False, "who": "bob"}])
    assert kinds(bench.station) == [Kind.RESET]
    bench.station.take([states(4.0)])
    assert kinds(bench.station) == []
    assert (bench.station.mark.colour, drives(bench.station)[0]) == ("good", "good")


def test_a_stop_of_others_after_a_reset_of_ours_takes_no_row_of_before_for_one_of_after(bench: Bench) -> None:
    ours(bench)
    bench.station.reset()
    bench.first.answer(OFF)
    bench.station.take([walking(5)])
    others(bench)
    assert bench.station.stopping.held
    assert kinds(bench.station) == [Kind.STOPPED]


def test_a_stop_that_nobody_has_answered_yet_leads_and_no_drive_is_green(bench: Bench) -> None:
    """For five seconds the robot's chip and card said in green that it was enabled."""
    assert bench.station.mark.colour == "good"
    bench.station.stop("test")
    assert bench.station.mark == STOP_SENT
    assert (STOP_SENT.shape, STOP_SENT.colour, STOP_SENT.word) == ("half", "warn", "STOP sent")
    assert drives(bench.station) == ("warn", "operation enabled")
    bench.first.answer(ALL)
    assert bench.station.mark.word == "STOPPED"


def test_a_stop_again_is_sent_and_is_not_called_stopped_before_its_answer(bench: Bench) -> None:
    bench.station.stop("test")
    bench.first.answer(Stopped({**ALL.drives, "left_knee": "unconfirmed"}, held=True))
    bench.station.take([states(6.0, left_knee=4.0)])
    assert kinds(bench.station) == [Kind.STILL_MOVING]
    assert enabled_again(bench.station.robot, bench.station.stopping) == []
    bench.station.stop("again")
    assert kinds(bench.station) == []
    assert bench.station.mark == STOP_SENT


def test_a_stop_that_is_sent_does_not_hide_a_fault(bench: Bench) -> None:
    bench.station.take(
        [states(4.0), looked(state="fault", problem="the drive is in fault: 0x2310 overcurrent")]
    )
    bench.station.stop("test")
    assert bench.station.mark.colour == "bad"


def test_what_is_to_be_done_is_the_same_everywhere(bench: Bench) -> None:
    ours(bench)
    bench.station.take([states(4.0)])
    assert remedy(bench.station.robot, bench.station.stopping) == ("STOP again", "or use the hardware stop")
    assert enabled_again(bench.station.robot, bench.station.stopping) == list(JOINTS)


def test_no_time_is_shorter_than_a_millisecond() -> None:
    stopping, at_ns = StopProgress(), 10**12
    number = stopping.sent(at_ns=at_ns)
    stopping.answered(number, Stopped({"left_knee": "confirmed"}, held=True), at_ns)
    assert stopping.state is StopState.CONFIRMED
    assert stopping.text == "STOP confirmed by the drive in 1 ms"
    assert stopping.answered_ms == 1.0
    stopping.show([at_ns], {"left_knee": ["quick stop active"]}, 0)
    assert not stopping.proofs["left_knee"].was_so
    stopping.proofs.clear()
    stopping.answered_ms = None
    assert stopping.slowest_ms == 1.0


def test_an_alarm_of_a_stop_is_since_when_the_line_above_it_says(bench: Bench) -> None:
    """Who stopped it again after somebody had enabled it saw two times, hours apart."""
    ours(bench)
    bench.station.stopping.since_s = time.time() - 10_000.0
    bench.look_again([states(6.0)])
    bench.station.stop("again")
    bench.station.stopping._off = set()  # somebody had enabled all of them
    bench.first.answer(ALL)
    (one,) = [one for one in bench.station.alarms.active if one.alarm.kind is Kind.STOPPED]
    assert one.since_s == bench.station.stopping.since_s
    assert one.since_s > time.time() - 1_000.0


def test_after_a_reset_nobody_says_of_a_robot_out_of_reach_that_its_drives_are_off(bench: Bench) -> None:
    ours(bench)
    bench.look_again([states(6.0)])
    bench.station.reset()
    bench.first.answer(OFF)
    bench.station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    (one,) = [one.alarm for one in bench.station.alarms.active if one.alarm.kind is Kind.RESET]
    assert one.what == "what its drives do now is not known"


def test_a_reset_of_another_stop_does_not_end_ours_that_nobody_has_answered(bench: Bench) -> None:
    """The robot was green while its STOP was on its way."""
    others(bench)
    bench.station.stop("test")
    bench.station.reset()
    bench.first.answer(OFF)
    assert bench.station.stopping.state is StopState.SENT
    assert bench.station.mark.colour != "good"
