"""Values that are wrong whatever the robot does: a fall, a joint beyond its drive's ends, heat."""

import math
import time

import pytest
from msgspec import UNSET, UnsetType
from msgspec.structs import replace

from gateway.client import ConnectionState
from gateway.wire.component import AngleInfo, ChannelInfo, QualityInfo, Snapshot
from gateway.wire.parameter import ParameterInfo, ParameterValue, ParameterValues
from gateway.wire.robot import GuardInfo, GuardRuleInfo
from server_gui.core.alarms import beyond
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import Described, LinkChanged, Looked
from server_gui.core.follow.frame_time import one_moment
from server_gui.core.follow.news import NewsKind
from tests.support.desk import JOINTS, Bench, described, kinds, looked, telemetry, walking_bench

LOW, HIGH = math.radians(-5.0), math.radians(120.0)
COUNT = 0.0001  # rad
ANGLE = AngleInfo(rad_per_count=COUNT, zero_offset=0.0)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return walking_bench(monkeypatch)


def now(bench: Bench, **values: float | None) -> None:
    """A row of now: `left_knee__position=2.0`."""
    now_ns = time.monotonic_ns()
    columns = {name.replace("__", "."): [value] for name, value in values.items()}
    bench.look_again([telemetry([now_ns], columns, now_ns)])


def _later(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    at_ns = time.monotonic_ns() + round(seconds * 1e9)
    monkeypatch.setattr(beyond, "now_ns", lambda: at_ns)


def told(station: Station, kind: Kind) -> Alarm | None:
    with one_moment():
        return next((one.alarm for one in station.alarms.active if one.alarm.kind is kind), None)


def with_ends(
    station: Station,
    low: float = LOW,
    high: float = HIGH,
    angle: AngleInfo | UnsetType = ANGLE,
    scale: float = COUNT,
    guard: GuardInfo | None = None,
) -> None:
    """Parameters of both ends, whose counts times `scale` are `low` and `high`."""
    infos = [
        ParameterInfo(
            name, "rad", None, None, None, live=True, states=None, component="left_knee", object=at,
            access="rw", store=True, scale=scale,
        )
        for name, at in (("left_knee.low", "0x607D:1"), ("left_knee.high", "0x607D:2"))
    ]  # fmt: skip
    held = {
        name: ParameterValue(value, "rad", None, None, 1)
        for name, value in (("left_knee.low", low), ("left_knee.high", high))
    }
    whole = looked()
    described_as = described().description
    components = [
        replace(part, angle=angle) if part.name == "left_knee" else part for part in described_as.components
    ]
    guard = guard or described_as.guard
    station.take([Described(replace(described_as, parameters=infos, components=components, guard=guard))])
    station.take([Looked(whole.quality, ParameterValues(held), whole.at_ns)])


@pytest.mark.parametrize(
    ("quantity", "degrees", "way"),
    [("tilt_forward", 80.0, "forward"), ("tilt_forward", -75.0, "backward"), ("tilt_side", -88.0, "a side")],
)
def test_a_trunk_that_lies_is_a_fall_until_somebody_knows_better(
    bench: Bench, quantity: str, degrees: float, way: str
) -> None:
    now(bench, **{f"trunk__{quantity}": math.radians(degrees)})
    alarm = told(bench.station, Kind.FALLEN)
    assert alarm is not None
    assert f"{abs(degrees):.0f}° " in alarm.what
    assert way in alarm.what
    assert alarm.channel in ("trunk.tilt_forward", f"trunk.{quantity}")  # of those that it has
    assert bench.station.mark.colour == "bad"
    assert any(item.about == "trunk" and "leans" in item.text for item in bench.desk.news.items)


def test_who_bends_to_stand_up_has_not_fallen(bench: Bench) -> None:
    now(bench, trunk__tilt_forward=math.radians(55.0))
    assert kinds(bench.station) == []


def test_a_robot_whose_drives_are_all_off_may_lie_as_it_is_laid(bench: Bench) -> None:
    now(bench, trunk__tilt_forward=1.5, **{f"{joint}__state": 6.0 for joint in JOINTS})
    assert told(bench.station, Kind.FALLEN) is None
    now(bench, trunk__tilt_forward=1.5, left_hip__state=4.0)
    assert told(bench.station, Kind.FALLEN) is not None


def test_a_joint_beyond_the_ends_of_its_drive_is_an_alarm(bench: Bench) -> None:
    with_ends(bench.station)
    now(bench, left_knee__position=math.radians(121.0), right_knee__position=math.radians(130.0))
    assert told(bench.station, Kind.BEYOND) is None
    now(bench, left_knee__position=math.radians(130.0))
    alarm = told(bench.station, Kind.BEYOND)
    assert alarm is not None
    assert alarm.line == "beyond its ends: left knee: it is at 130°, its drive's range is −5° to 120°"
    now(bench, left_knee__position=math.radians(-8.0))
    alarm = told(bench.station, Kind.BEYOND)
    assert alarm is not None
    assert "at −8°" in alarm.what


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.0), (1.0, 1.0)])
def test_ends_that_are_equal_are_none(bench: Bench, low: float, high: float) -> None:
    with_ends(bench.station, low, high)
    now(bench, left_knee__position=2.2)
    assert told(bench.station, Kind.BEYOND) is None


def test_a_hot_drive_is_told_and_is_over_some_seconds_after_it_has_cooled(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that swings about the limit is one alarm."""
    now(bench, left_knee__temperature=98.8)
    assert told(bench.station, Kind.HOT) is not None
    now(bench, left_knee__temperature=84.9)
    assert told(bench.station, Kind.HOT) is not None
    _later(monkeypatch, beyond.HELD_S)
    now(bench, left_knee__temperature=84.9)
    assert told(bench.station, Kind.HOT) is None


def test_what_was_last_known_does_not_end_by_being_unknown(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    now(bench, trunk__tilt_side=1.4)
    robot = bench.station.robot
    monkeypatch.setattr(robot.__class__, "is_stale", lambda *_: True)
    _later(monkeypatch, 60.0)
    bench.station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    alarm = told(bench.station, Kind.FALLEN)
    assert alarm is not None
    assert not alarm.is_now


@pytest.mark.parametrize("value", [None, math.nan])
def test_what_is_not_known_is_beyond_nothing(bench: Bench, value: float | None) -> None:
    with_ends(bench.station)
    now(bench, left_knee__temperature=value, trunk__tilt_side=value, left_knee__position=value)
    assert kinds(bench.station) == []


def test_a_rule_of_a_guard_that_runs_decides_instead(bench: Bench) -> None:
    rule = GuardRuleInfo(
        "heat", "temperature", "above 110 °C", ["left_knee"], ["alarm"], "alarm", "watching", 0, None, 0, [],
        quantities=["temperature"], high=110.0,
    )  # fmt: skip
    description = described().description
    bench.station.take([Described(replace(description, guard=GuardInfo(configured=True, rules=[rule])))])
    now(bench, left_knee__temperature=98.8, right_knee__temperature=98.8)
    alarm = told(bench.station, Kind.HOT)
    assert alarm is not None
    assert alarm.subject == "right_knee"
    broken = GuardInfo(configured=True, problem="no thread", rules=[rule])
    bench.station.take([Described(replace(description, guard=broken))])
    now(bench, left_knee__temperature=98.8, right_knee__temperature=20.0)
    with one_moment():
        hot = {one.alarm.subject for one in bench.station.alarms.active if one.alarm.kind is Kind.HOT}
    assert "left_knee" in hot


@pytest.mark.parametrize(
    ("angle", "scale", "inside", "outside"),
    [
        (AngleInfo(COUNT, math.radians(90.0)), COUNT, 150.0, 30.0),  # the drive's 0 is at 90°
        (AngleInfo(-COUNT, 0.0), COUNT, -60.0, 30.0),  # counts fall when it bends
        (AngleInfo(COUNT, 0.0), -COUNT, 60.0, -60.0),  # its parameter counts the other way
        (AngleInfo(COUNT, 0.0), 1.0, 60.0, -60.0),  # it is in counts
    ],
)
def test_ends_are_angles_of_the_joint_as_its_position_is(
    bench: Bench, angle: AngleInfo, scale: float, inside: float, outside: float
) -> None:
    """A joint far beyond its end was green, and one in its middle red."""
    with_ends(bench.station, LOW / COUNT * scale, HIGH / COUNT * scale, angle, scale)
    now(bench, left_knee__position=math.radians(inside))
    assert told(bench.station, Kind.BEYOND) is None
    now(bench, left_knee__position=math.radians(outside))
    assert told(bench.station, Kind.BEYOND) is not None


def test_ends_are_not_known_where_nobody_knows_what_a_count_is(bench: Bench) -> None:
    with_ends(bench.station, angle=UNSET)
    now(bench, left_knee__position=2.5)
    assert told(bench.station, Kind.BEYOND) is None


def test_a_rule_with_a_limit_on_one_side_decides_of_that_side_alone(bench: Bench) -> None:
    rule = GuardRuleInfo(
        "flexion", "joint_limit", "above 120°", ["left_knee"], ["alarm"], "alarm", "watching", 0, None, 0, [],
        quantities=["position"], high=HIGH,
    )  # fmt: skip
    with_ends(bench.station, guard=GuardInfo(configured=True, rules=[rule]))
    now(bench, left_knee__position=math.radians(140.0))
    assert told(bench.station, Kind.BEYOND) is None, "the guard tells it"
    now(bench, left_knee__position=math.radians(-40.0))
    assert told(bench.station, Kind.BEYOND) is not None


def test_a_fall_does_not_end_because_its_sensor_is_lost(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    now(bench, trunk__tilt_forward=1.5)
    for later_s in (1.0, 2.0 * beyond.HELD_S, 5.0 * beyond.HELD_S):
        _later(monkeypatch, later_s)
        now(bench, trunk__tilt_forward=None, left_knee__position=0.1)
        alarm = told(bench.station, Kind.FALLEN)
        assert alarm is not None
        assert not alarm.is_now
    for later_s in (26.0, 26.0 + beyond.HELD_S):
        _later(monkeypatch, later_s)
        now(bench, trunk__tilt_forward=0.1)
    assert told(bench.station, Kind.FALLEN) is None


def test_a_value_whose_channel_is_gone_is_no_alarm_for_good(bench: Bench) -> None:
    now(bench, left_knee__temperature=95.0)
    description = described().description
    channels = [one for one in description.channels if one.name != "left_knee.temperature"]
    bench.station.take([Described(replace(description, channels=channels))])
    now(bench, left_knee__position=0.1)
    assert told(bench.station, Kind.HOT) is None


@pytest.mark.parametrize(
    ("state", "high", "is_told"),
    [("watching", 1.0, False), ("watching", 1.5, True), ("blind", 1.0, True), ("odd", 1.0, True)],
)
def test_a_guard_tells_a_fall_only_where_it_sees_and_trips_no_later(
    bench: Bench, state: str, high: float, is_told: bool
) -> None:
    rule = GuardRuleInfo(
        "lean", "tilt", "above", ["trunk"], ["alarm"], "alarm", state, 0, None, 0, [],
        quantities=["tilt_forward", "tilt_side"], low=-high, high=high,
    )  # fmt: skip
    description = described().description
    bench.station.take([Described(replace(description, guard=GuardInfo(configured=True, rules=[rule])))])
    now(bench, trunk__tilt_forward=math.radians(80.0))
    assert (told(bench.station, Kind.FALLEN) is not None) is is_told


def guarded(bench: Bench, state: str, *, with_channel: bool = False) -> None:
    """A rule of the trunk's tilt, in this state as the link came."""
    rule = GuardRuleInfo(
        "lean", "tilt", "above", ["trunk"], ["alarm"], "alarm", state, 0, None, 0, [],
        quantities=["tilt_forward", "tilt_side"], low=-1.0, high=1.0,
    )  # fmt: skip
    description = described().description
    words = {"0": "watching", "1": "cleared", "2": "blind", "3": "tripped"}
    channel = ChannelInfo("guard.lean", "", "guard", "lean", enum=words)
    channels = [*description.channels, *([channel] if with_channel else [])]
    guard = GuardInfo(configured=True, rules=[rule])
    bench.station.take([Described(replace(description, guard=guard, channels=channels))])


def test_a_fall_is_left_to_a_rule_no_longer_than_for_some_seconds(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rule may wait for a minute, or never trip."""
    guarded(bench, "watching")
    now(bench, trunk__tilt_forward=1.5)
    assert told(bench.station, Kind.FALLEN) is None
    _later(monkeypatch, 2.0 * beyond.HELD_S)
    now(bench, trunk__tilt_forward=0.1)
    now(bench, trunk__tilt_forward=1.5)
    _later(monkeypatch, beyond.LEFT_S + 1.0)
    now(bench, trunk__tilt_forward=1.5)
    assert told(bench.station, Kind.FALLEN) is None, "it is another fall"
    for later_s in range(12, 23):  # it swings about the limit
        _later(monkeypatch, later_s)
        now(bench, trunk__tilt_forward=0.9 if later_s == 15 else 1.5)
    assert told(bench.station, Kind.FALLEN) is not None


def test_a_fall_that_was_left_to_a_rule_is_last_known_where_the_link_goes(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    guarded(bench, "watching")
    now(bench, trunk__tilt_forward=1.5)
    monkeypatch.setattr(type(bench.station.robot), "is_stale", lambda *_: True)
    bench.station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    alarm = told(bench.station, Kind.FALLEN)
    assert alarm is not None
    assert not alarm.is_now


@pytest.mark.parametrize(
    ("value", "is_told"), [(0.0, False), (3.0, False), (2.0, True), (None, True), (7.0, True)]
)
def test_a_rule_of_which_nobody_knows_whether_it_sees_hides_no_fall(
    bench: Bench, value: float | None, is_told: bool
) -> None:
    guarded(bench, "watching", with_channel=True)
    now(bench, trunk__tilt_forward=1.5, guard__lean=value)
    assert (told(bench.station, Kind.FALLEN) is not None) is is_told


def test_a_tilt_to_the_side_that_is_over_ends_no_other_that_is_not_known(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    now(bench, trunk__tilt_forward=1.5, trunk__tilt_side=0.0)
    now(bench, trunk__tilt_forward=None, trunk__tilt_side=1.2)
    now(bench, trunk__tilt_forward=None, trunk__tilt_side=0.0)
    _later(monkeypatch, 2.0 * beyond.HELD_S)
    now(bench, trunk__tilt_forward=None, trunk__tilt_side=0.0)
    alarm = told(bench.station, Kind.FALLEN)
    assert alarm is not None
    assert not alarm.is_now


def test_a_calendar_that_jumps_ends_no_heat(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    now(bench, left_knee__temperature=95.0)
    now(bench, left_knee__temperature=80.0)
    later_s = time.time() + 1000.0
    monkeypatch.setattr(bench.station.robot.__class__, "now_s", lambda _: later_s)
    now(bench, left_knee__temperature=80.0)
    assert told(bench.station, Kind.HOT) is not None


def test_what_is_much_hotter_than_what_was_read_is_to_be_read_again(bench: Bench) -> None:
    now(bench, left_knee__temperature=89.9)
    alarm = told(bench.station, Kind.HOT)
    assert alarm is not None
    bench.station.acknowledge(alarm)
    for temperature, is_read in ((90.1, True), (86.0, True), (99.0, True), (101.0, False)):
        now(bench, left_knee__temperature=temperature)
        (one,) = [one for one in bench.station.alarms.active if one.alarm.kind is Kind.HOT]
        assert one.is_acknowledged is is_read
    bench.station.acknowledge(one.alarm)
    for temperature in (86.0, 101.0):  # it has been as hot, and somebody has read it
        now(bench, left_knee__temperature=temperature)
        (one,) = [one for one in bench.station.alarms.active if one.alarm.kind is Kind.HOT]
        assert one.is_acknowledged


def test_a_second_fall_is_an_event_again(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def falls() -> int:
        return sum(one.count for one in bench.desk.news.items if "leans" in one.text)

    now(bench, trunk__tilt_forward=1.5)
    assert falls() == 1
    now(bench, trunk__tilt_forward=0.0)
    with monkeypatch.context() as patched:
        _later(patched, 2.0 * beyond.HELD_S)
        now(bench, trunk__tilt_forward=0.0)
    assert told(bench.station, Kind.FALLEN) is None
    now(bench, trunk__tilt_forward=1.4)
    assert falls() == 2


def test_several_values_that_go_beyond_at_once_are_one_event_as_bad_as_its_alarm(bench: Bench) -> None:
    now(bench, trunk__tilt_forward=1.5)
    assert (bench.desk.news.items[0].kind, bench.desk.news.items[0].about) == (NewsKind.FAULT, "trunk")
    hot = dict.fromkeys((f"{joint}__temperature" for joint in JOINTS), 95.0)
    now(bench, **hot)
    newest = bench.desk.news.items[0]
    assert newest.kind is NewsKind.WARNING
    assert newest.text.startswith("left hip, left knee, left ankle, right hip, right knee, right ankle: hot")
    now(bench, **hot)
    assert bench.desk.news.items[0] is newest


def test_a_robots_words_are_one_line_whatever_they_hold(bench: Bench) -> None:
    forged: QualityInfo = {"state": "lost", "age_ms": 9.0, "problem": "no heartbeat\n→ nothing to do"}
    whole = looked()
    bench.station.take([Looked(Snapshot(0, {}, {}, {"left_knee": forged}), whole.parameters, whole.at_ns)])
    assert bench.station.robot.parts["left_knee"].problem == "no heartbeat → nothing to do"
    with one_moment():
        assert not any("\n" in one.alarm.line + one.alarm.check for one in bench.station.alarms.active)


def test_a_fall_lasts_over_the_reset_of_the_stop_after_it(bench: Bench) -> None:
    now(bench, trunk__tilt_forward=1.5)
    assert told(bench.station, Kind.FALLEN) is not None
    now(bench, trunk__tilt_forward=1.5, **{f"{joint}__state": 6.0 for joint in JOINTS})
    assert told(bench.station, Kind.FALLEN) is not None, "nobody has stood up"


def test_ends_that_become_unknown_end_no_alarm(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    with_ends(bench.station)
    now(bench, left_knee__position=2.5)
    assert told(bench.station, Kind.BEYOND) is not None
    bench.station.robot.parameters.clear()
    for later_s in (1.0, 3.0 * beyond.HELD_S):
        _later(monkeypatch, later_s)
        now(bench, left_knee__position=2.5)
        alarm = told(bench.station, Kind.BEYOND)
        assert alarm is not None
        assert not alarm.is_now


def test_an_imu_on_a_thigh_says_nothing_of_a_fall(bench: Bench) -> None:
    description = described().description
    thigh = replace(description.components[-2], name="left_thigh")
    bench.station.take([Described(replace(description, components=[*description.components, thigh]))])
    now(bench, left_thigh__tilt_forward=1.5)
    assert told(bench.station, Kind.FALLEN) is None
