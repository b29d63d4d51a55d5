"""Alarms that last: when they are to be read again, where they began, what is said of the unknown."""

import time

import pytest
from msgspec.structs import replace

from gateway.client import ConnectionState
from gateway.wire.component import ChannelInfo
from gateway.wire.robot import GuardInfo, GuardRuleInfo
from gateway.wire.stop import Reset, StopInfo, Stopped
from server_gui.core.alarms.alarm import Active
from server_gui.core.alarms.drive_states import moving_joints
from server_gui.core.alarms.robot_alarms import UNLOOKED_S
from server_gui.core.alarms.texts import Kind
from server_gui.core.alarms.unconfirmed import silent_controllers
from server_gui.core.follow import frame_time
from server_gui.core.follow.events import Described, Event, LinkChanged
from tests.support.desk import JOINTS, Bench, described, kinds, looked, telemetry, walking_bench

NO_ROOM = "this stop is held, but not beyond this gateway: No space left on device"


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return walking_bench(monkeypatch)


def row(number: float = 4.0, **others: float | None) -> Event:
    """A row of now with every drive in this state, and others: `left_knee__velocity=1.0`."""
    now_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {f"{joint}.state": [number] for joint in JOINTS}
    columns |= {name.replace("__", "."): [value] for name, value in others.items()}
    return telemetry([now_ns], columns, now_ns)


def the(bench: Bench, kind: Kind) -> Active:
    return next(one for one in bench.station.alarms.active if one.alarm.kind is kind)


def test_another_fault_of_a_drive_is_to_be_read_again(bench: Bench) -> None:
    station = bench.station
    for code, is_read in (("0x8130", False), ("0x8130", True), ("0x2310", False)):
        station.take(
            [row(left_knee__state=7.0), looked(state="fault", problem=f"the drive is in fault: {code} x")]
        )
        assert the(bench, Kind.FAULT).is_acknowledged is is_read
        station.acknowledge(the(bench, Kind.FAULT).alarm)


def test_looks_that_fail_for_long_make_ok_what_it_was(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows came, no look at the devices did: everything was ok, for ever."""
    station = bench.station
    station.take([row(), looked()])
    assert kinds(station) == []
    later_ns = time.monotonic_ns() + round((UNLOOKED_S + 1.0) * 1e9)
    with monkeypatch.context() as patched:
        patched.setattr(frame_time, "now_ns", lambda: later_ns)
        station.take([replace_row(later_ns)])
        assert kinds(station) == [Kind.UNKNOWN]
        assert station.mark.colour != "good"
        assert "has not come" in the(bench, Kind.UNKNOWN).alarm.what
        station.take([looked(at_ns=later_ns)])
        assert kinds(station) == []


def replace_row(at_ns: int) -> Event:
    columns: dict[str, list[float | None]] = {f"{joint}.state": [4.0] for joint in JOINTS}
    return telemetry([at_ns], columns, at_ns)


def test_a_stop_that_will_not_outlive_its_gateway_says_so(bench: Bench) -> None:
    station = bench.station
    station.stop("test")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True, problem=NO_ROOM))
    station.take([row(6.0)])
    assert the(bench, Kind.STOPPED).alarm.why == NO_ROOM
    assert NO_ROOM in bench.desk.news.items[0].text
    other = bench.add("exo-02", 7421)
    known = described("exo-02").description
    held = replace(known.stop, held=True, reason="door", problem=NO_ROOM)
    other.take([Described(replace(known, stop=held))])
    (one,) = [one.alarm for one in other.alarms.active if one.alarm.kind is Kind.STOPPED]
    assert one.why == NO_ROOM


@pytest.mark.parametrize("anew", [False, True])
def test_a_robot_that_lost_its_stop_and_is_enabled_is_no_good_robot(bench: Bench, anew: bool) -> None:
    station = bench.station
    station.stop("test")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    for state in (ConnectionState.WAITING, ConnectionState.CONNECTED):
        station.take([LinkChanged(state, "gone", time.monotonic_ns())])
    known = described().description
    known = replace(known, boot_id="another") if anew else known
    station.take([Described(known), looked(), row()])
    assert isinstance(known.stop, StopInfo)
    assert Kind.NOT_HELD in kinds(station)
    assert station.mark.colour == "bad"
    station.reset()
    assert Kind.NOT_HELD in kinds(station)


def test_where_an_alarm_began_is_not_on_the_axis_of_another_start(bench: Bench) -> None:
    station = bench.station
    station.take([row(left_knee__state=7.0)])
    assert the(bench, Kind.FAULT).at_ns is not None
    station.take([Described(replace(described().description, boot_id="another"))])
    assert all(one.at_ns is None for one in station.alarms.active)


def test_a_joint_that_turns_backwards_moves(bench: Bench) -> None:
    still: dict[str, float | None] = {f"{joint}__velocity": 0.0 for joint in JOINTS}
    bench.station.take([row(6.0, **still | {"left_knee__velocity": -1.0, "right_knee__velocity": 1.0})])
    assert moving_joints(bench.station.robot) == ["left_knee", "right_knee"]


def test_of_old_rows_nobody_says_that_all_drives_are_off(bench: Bench) -> None:
    station = bench.station
    station.take([row(6.0, **{f"{joint}__velocity": 0.0 for joint in JOINTS})])
    station.stop("test")
    bench.first.answer(
        Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True, controllers={"gait": "unreachable"})
    )
    assert "all 6 drives are off" in silent_controllers(station.robot, station.stopping)
    station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    assert silent_controllers(station.robot, station.stopping) == ""


def test_what_is_not_known_now_is_no_alarm_of_now(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    rule = GuardRuleInfo(
        "lean", "tilt", "above", ["trunk"], ["stop"], "alarm", "tripped", 0, None, 1, [],
        quantities=["tilt_forward"], high=1.0,
    )  # fmt: skip
    known = described().description
    channel = ChannelInfo("guard.lean", "", "guard", "lean", enum={"3": "tripped"})
    guard = GuardInfo(configured=True, rules=[rule])
    station = bench.station
    station.take([Described(replace(known, guard=guard, channels=[*known.channels, channel]))])
    station.take([row(left_knee__state=7.0, guard__lean=3.0), looked()])
    for kind in (Kind.FAULT, Kind.GUARD):
        assert the(bench, kind).alarm.is_now
    station.take([row(left_knee__state=7.0, guard__lean=None)])
    assert not the(bench, Kind.GUARD).alarm.is_now
    monkeypatch.setattr(type(station.robot), "is_stale", lambda *_: True)
    station.take([])
    for kind in (Kind.FAULT, Kind.GUARD):
        assert not the(bench, kind).alarm.is_now


def test_a_code_that_is_not_known_for_a_row_makes_no_alarm_unread(bench: Bench) -> None:
    station, reads = bench.station, list[bool]()
    for code in (float(0x2310), None, float(0x2310), 0.0):
        station.take([row(left_knee__state=7.0, left_knee__error_code=code)])
        if the(bench, Kind.FAULT).alarm.grade and not reads:
            station.acknowledge(the(bench, Kind.FAULT).alarm)
        reads.append(the(bench, Kind.FAULT).is_acknowledged)
    assert reads == [True] * 4


def test_a_reset_without_a_stop_has_cleared_faults_and_says_how_to_go_on(bench: Bench) -> None:
    """Nobody had pressed STOP, and it was called a stop that was reset."""
    station = bench.station
    station.take([row(6.0, left_knee__state=7.0)])
    for _ in range(2):
        station.reset()
        bench.first.answer(Reset(dict.fromkeys(JOINTS, "switch on disabled"), {}, held=False))
        station.take([row(6.0)])
        assert the(bench, Kind.RESET).alarm.line.startswith("faults cleared: every drive is off")
        assert "enable the drives" in the(bench, Kind.RESET).alarm.check
        assert bench.desk.news.items[0].text.startswith("faults cleared, every drive is off")
    station.stop("test")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    station.reset()
    bench.first.answer(Reset(dict.fromkeys(JOINTS, "switch on disabled"), {}, held=False))
    assert the(bench, Kind.RESET).alarm.mark.word == "stop reset"
