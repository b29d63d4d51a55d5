"""Alarms of a robot's buses, of its guard, and of what is read from both."""

import time

import pytest
from msgspec.structs import replace

from gateway.wire.bus import BusInfo
from gateway.wire.component import QualityInfo, Snapshot
from gateway.wire.robot import GuardInfo, GuardRuleInfo
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.events import BusesSeen, Described, Looked
from server_gui.core.follow.news import NewsKind
from tests.support.desk import Bench, described, kinds, looked, walking, walking_bench

FINE = BusInfo("main", "error active", 1_000_000, 41.0, 1010.0, 0, 0, 1, 0, [])


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return walking_bench(monkeypatch)


def test_a_bus_that_is_full_now_is_an_alarm_and_is_over_when_it_is_not(bench: Bench) -> None:
    bench.station.take([BusesSeen((replace(FINE, load_percent=100.0),), time.monotonic_ns())])
    (one,) = bench.station.alarms.active
    assert (one.alarm.kind, one.alarm.is_now) == (Kind.BUS_FULL, True)
    assert one.alarm.what == "100 % of its time is taken"
    assert bench.station.mark.colour == "bad"
    bench.station.take([BusesSeen((FINE,), time.monotonic_ns())])
    assert kinds(bench.station) == []


def test_a_bus_that_is_full_or_fails_is_an_event_as_it_begins(bench: Bench) -> None:
    """Of its alarm nothing was left once it was over."""
    station = bench.station
    for load in (100.0, 100.0, 20.0):
        station._watched_ns = 0
        station.take([BusesSeen((replace(FINE, load_percent=load),), time.monotonic_ns())])
    told = [item.text for item in bench.desk.news.items if "bus full" in item.text]
    assert told == [f"{FINE.name}: bus full: 100 % of its time is taken"]


def test_the_load_of_a_bus_has_a_beginning_of_its_own(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """It seemed to be as old as the PDOs that had been missing since long before."""
    passive = replace(FINE, state="error passive")
    bench.station.take([BusesSeen((passive,), time.monotonic_ns())])
    (before,) = bench.station.alarms.active
    now_s = time.time() + 60.0
    monkeypatch.setattr("server_gui.core.follow.robot.Robot.now_s", lambda _robot: now_s)
    bench.station.take([BusesSeen((replace(passive, load_percent=90.0),), time.monotonic_ns())])
    since = {one.alarm.kind: one.since_s for one in bench.station.alarms.active}
    assert since[Kind.BUS] == before.since_s
    assert since[Kind.BUS_BUSY] >= before.since_s + 59.0


def test_what_a_robot_told_of_its_buses_with_the_link_counts_until_somebody_looks(bench: Bench) -> None:
    told = replace(described().description, buses=[replace(FINE, state="error passive")])
    bench.station.take([Described(told)])
    (one,) = bench.station.alarms.active
    assert (one.alarm.kind, one.alarm.what, one.alarm.is_now) == (Kind.BUS, "error passive", False)
    bench.station.take([BusesSeen((FINE,), time.monotonic_ns())])
    assert kinds(bench.station) == []


def test_a_guard_that_does_not_run_is_blind_though_it_has_rules(bench: Bench) -> None:
    rule = GuardRuleInfo(
        "knee_heat", "torque", "above 60 N·m", ["left_knee"], [], "alarm", "watching", 0, None, 0, []
    )
    guard = GuardInfo(configured=True, problem="its thread has ended", rules=[rule])
    bench.station.take([Described(replace(described().description, guard=guard)), walking(5)])
    (one,) = bench.station.alarms.active
    assert one.alarm.line == "guard blind: the guard: it does not run: its thread has ended"


def test_devices_that_a_gateway_begins_to_read_are_one_alarm_and_not_lost(bench: Bench) -> None:
    bench.station.take([described(), walking(10)])
    quality: dict[str, QualityInfo] = {
        name: {"state": "lost", "age_ms": None, "problem": "it was not read yet: look again in a moment"}
        for name in ("left_hip", "left_knee")
    }
    bench.look_again([Looked(Snapshot(0, {}, {}, quality), None, time.monotonic_ns())])
    (one,) = bench.station.alarms.active
    assert one.alarm.line == "no data yet: devices: not read yet: left hip, left knee"
    assert bench.station.mark.colour == "old"
    assert not [item for item in bench.station.news.items if item.kind is NewsKind.LOST]


def test_data_that_comes_in_bursts_are_silent_since_the_newest_row(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It said for 34 s while the newest row was 3 s old."""
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 0)
    found = []
    for _ in range(2):
        bench.station.take([walking(2)])
        (one,) = (one for one in bench.station.alarms.active if one.alarm.kind is Kind.STALE)
        found.append(one)
        assert bench.station.robot.now_s() - one.since_s == pytest.approx(
            bench.station.robot.age_s() or 0.0, abs=0.05
        )
    assert found[1].since_s > found[0].since_s


def test_how_long_a_heartbeat_is_missing_is_what_it_was_at_least(bench: Bench) -> None:
    """It said for 0.2 s beside for 2 s."""
    problem = "its heartbeat has been missing for 0.2 s: check the node's power and cable"
    bench.station.take([looked(state="stale", problem=problem)])
    (one,) = bench.station.alarms.active
    assert one.alarm.what == "its heartbeat has been missing for more than 0.2 s"
