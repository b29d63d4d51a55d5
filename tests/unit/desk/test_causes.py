"""Alarms with one cause are one alarm: a computer that stood still, a node that has gone."""

import time

import pytest
from msgspec.structs import replace

from gateway.client import Batch, ClockOffset
from gateway.wire.component import QualityInfo, Snapshot
from server_gui.core.alarms.alarm import Active, Alarm, Alarms
from server_gui.core.alarms.causes import AFTER_S, OWN_S, TOLD_S, Stall, Stalls, gathered, stood_still
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk.desk import Desk
from server_gui.core.follow.events import Described, Looked, Telemetry
from server_gui.core.follow.news import NewsKind
from tests.support.desk import JOINTS, Bench, described, looked, telemetry, walking

SECOND_NS = 1_000_000_000
STALL = Stall(100.0, 1.2)
PARTS = 10  # of the robot
HEARTBEAT = "it reports 0x8130 life guard or heartbeat error (register: generic, communication)"


def active(kind: Kind, subject: str, since_s: float, what: str = "", node: str = "") -> Active:
    return Active(Alarm(kind, subject, what or subject, node=node), since_s)


def stood(stalls: tuple[Stall, ...] = (STALL,)) -> Active:
    (alarm,) = stood_still(stalls)
    return Active(alarm, stalls[0].began_s)


def stamps(begin: float, end: float) -> list[int]:
    """At 100 Hz."""
    return [round(at * SECOND_NS / 100) for at in range(round(begin * 100), round(end * 100))]


def test_rows_that_come_late_and_at_once_say_that_the_gateway_stood_still() -> None:
    stalls = Stalls()
    assert stalls.take(1, stamps(0.0, 1.0), SECOND_NS, 1000.0) is None, "nobody knows what was before"
    assert stalls.take(1, stamps(1.0, 1.05), round(1.05 * SECOND_NS), 1000.05) is None
    found = stalls.take(1, stamps(1.05, 2.25), round(2.25 * SECOND_NS), 1001.25)
    assert found is not None
    assert found.began_s == pytest.approx(1000.05)
    assert found.lasted_s == pytest.approx(1.2)


def test_rows_that_a_network_held_up_come_in_pieces_and_blame_nobody() -> None:
    stalls = Stalls()
    stalls.take(1, stamps(0.0, 0.05), SECOND_NS // 20, 1000.0)
    for piece in range(1, 30):
        begin = piece * 0.05
        assert stalls.take(1, stamps(begin, begin + 0.05), round(1.5 * SECOND_NS) + piece, 1001.5) is None


def test_another_link_or_stream_blames_nobody() -> None:
    stalls = Stalls()
    stalls.take(1, stamps(0.0, 1.0), SECOND_NS, 1000.0)
    assert stalls.take(2, stamps(1.0, 4.0), 4 * SECOND_NS, 1003.0) is None
    stalls.forget()
    assert stalls.take(2, stamps(5.0, 9.0), 9 * SECOND_NS, 1008.0) is None


def test_a_flood_after_a_stall_is_one_alarm_as_bad_as_its_worst() -> None:
    flood = [active(Kind.IMPLAUSIBLE, joint, 101.5) for joint in JOINTS]
    flood += [active(Kind.BUS, "bus.can0", 103.0), active(Kind.PART_STALE, "gait", 100.9)]
    (one,) = gathered([stood(), *flood], (STALL,), 104.0, PARTS)
    assert one.alarm.line == "computer halted: computer: the robot's computer stood still for 1.2 s"
    assert (one.alarm.mark.colour, one.alarm.mark.word) == ("bad", "computer halted")
    assert "unreliable: left hip, left knee" in one.alarm.consequences
    assert len(one.alarm.under) == len(flood)


@pytest.mark.parametrize(
    ("kind", "since_s", "now_s"),
    [
        (Kind.FAULT, 101.0, 102.0),  # a drive is in fault, whatever the reason
        (Kind.GUARD, 101.0, 102.0),
        (Kind.NOT_STOPPED, 101.0, 102.0),
        (Kind.LOST, 90.0, 102.0),  # it was before
        (Kind.LOST, 101.2 + AFTER_S + 0.1, 110.0),  # long after
        (Kind.LOST, 101.0, 101.2 + OWN_S + 0.1),  # it lasts
    ],
)
def test_what_a_stall_does_not_explain_stands_for_itself(kind: Kind, since_s: float, now_s: float) -> None:
    found = gathered([stood(), active(kind, "left_knee", since_s)], (STALL,), now_s, PARTS)
    assert kind in [one.alarm.kind for one in found]


def each_lost(*names: str, what: str = "no heartbeat") -> list[Active]:
    """Parts that are lost since the stall."""
    return [active(Kind.LOST, name, 101.0, what) for name in names]


def test_a_stall_explains_lost_parts_where_half_of_all_are_late_and_its_word_counts_them() -> None:
    late = [active(Kind.PART_STALE, name, 101.0) for name in ("gait", "trunk")]
    (one,) = gathered([stood(), *each_lost(*JOINTS[:3]), *late], (STALL,), 102.0, PARTS)
    assert one.alarm.kind is Kind.STALLED
    assert (one.alarm.mark.colour, one.alarm.mark.word) == ("bad", "computer halted, 3 lost")
    assert "lost: left hip" in one.alarm.consequences
    assert one.alarm.rank == each_lost("any")[0].alarm.rank


def test_a_part_that_is_lost_with_a_stall_while_most_are_well_leads() -> None:
    stale = active(Kind.PART_STALE, "gait", 101.0)
    alarms = Alarms()
    found = [stood().alarm, *(one.alarm for one in (*each_lost("left_knee"), stale))]
    alarms.look(found, 101.0, gather=lambda known: gathered(known, (STALL,), 102.0, PARTS))
    first, second = alarms.active
    assert (first.alarm.kind, first.alarm.subject) == (Kind.LOST, "left_knee")
    assert (second.alarm.kind, [one.subject for one in second.alarm.under]) == (Kind.STALLED, ["gait"])
    assert alarms.worst is not None
    assert alarms.worst.kind is Kind.LOST, "as its card says"


def test_no_stall_takes_a_port_away() -> None:
    gone = each_lost(*JOINTS, what="/dev/ttyUSB0 does not exist")
    found = gathered([stood(), *gone], (STALL,), 102.0, PARTS)
    assert [one.alarm.subject for one in found if one.alarm.kind is Kind.LOST] == list(JOINTS)


def test_a_stall_after_which_nothing_is_wrong_is_told_for_a_while() -> None:
    assert gathered([stood()], (STALL,), STALL.ended_s + TOLD_S - 0.1, PARTS)
    assert gathered([stood()], (STALL,), STALL.ended_s + TOLD_S + 0.1, PARTS) == []


def test_a_short_stall_is_told_only_of_what_it_explains() -> None:
    short = (Stall(100.0, 0.3),)
    assert gathered([stood(short)], short, 101.0, PARTS) == []
    (one,) = gathered([stood(short), active(Kind.IMPLAUSIBLE, "left_knee", 101.0)], short, 102.0, PARTS)
    assert one.alarm.what == "the robot's computer stood still for 0.3 s"


@pytest.mark.parametrize("kind", [Kind.IMPLAUSIBLE, Kind.REPORTS, Kind.FAULT])
def test_a_node_that_has_gone_stands_above_those_that_miss_its_heartbeat(kind: Kind) -> None:
    lost = active(Kind.LOST, "left_knee", 100.0, "its heartbeat has been missing for 2.2 s", "main")
    others = [
        active(kind, "gait", 100.1, HEARTBEAT, "main"),
        active(Kind.BUS, "bus.main", 101.0, "32 error frames in the last 10 s"),
    ]
    (one,) = gathered([*others, lost], (), 105.0, PARTS)
    assert one.alarm.kind is Kind.LOST
    assert one.alarm.subject == "left_knee"
    assert [under.subject for under in one.alarm.under] == ["gait", "bus.main"]


@pytest.mark.parametrize(
    "other",
    [
        active(Kind.FAULT, "right_hip", 100.1, "0x2310 continuous overcurrent at the output", "main"),
        active(Kind.BUS, "bus.other", 101.0),
        active(Kind.BUS_FAILS, "bus.main", 101.0),
        active(Kind.LOST, "right_knee", 101.0, "its heartbeat is missing", "main"),
    ],
)
def test_what_a_node_that_has_gone_does_not_explain_stands_for_itself(other: Active) -> None:
    lost = active(Kind.LOST, "left_knee", 100.0, "its heartbeat has been missing for 2.2 s", "main")
    assert [one.alarm.key for one in gathered([other, lost], (), 105.0, PARTS)] == [
        other.alarm.key,
        lost.alarm.key,
    ]


def test_a_robot_whose_computer_stood_still_says_so_and_its_worst_stays_the_worst() -> None:
    bench = Bench(Desk())
    station = bench.add("exo-01")
    walk = walking(100)
    station.take([described(), walk])
    now_ns = walk.batch.received_ns
    columns: dict[str, list[float | None]] = {"left_knee.position": [0.0] * 120}
    late = [now_ns + round(row * 1e7) for row in range(1, 121)]
    batch = Batch(late, columns, 0, 0, 0, 1, now_ns + round(1.2e9))
    lost = looked(state="fault", problem="its position jumped by 6.3°")
    bench.look_again([Telemetry(1, batch, ClockOffset(0, 0)), lost])
    (one,) = station.alarms.active
    assert one.alarm.kind is Kind.STALLED
    assert station.mark.colour == "bad"
    assert [(item.kind, item.text) for item in station.news.items if "stood" in item.text] == [
        (NewsKind.WARNING, "the robot's computer stood still for 1.2 s")
    ]
    station.alarms.acknowledge(one.alarm.key)
    (one,) = station.alarms.active
    assert one.is_acknowledged
    assert station.alarms.worst is not None, "that it is read does not make it better"


def test_stalls_that_follow_each_other_are_one_event_until_one_is_far_longer() -> None:
    stalls, told, at_s = Stalls(), list[float](), 0.0
    stalls.take(1, stamps(0.0, 0.05), 0, 1000.0)
    for lasted_s in (0.3, 0.6, 0.7, 0.5, 1.0, 2.0, 0.6):
        began_s, at_s = at_s, at_s + lasted_s
        found = stalls.take(1, stamps(began_s + 0.06, at_s + 0.05), round(at_s * SECOND_NS), 1000.0 + at_s)
        assert found is not None
        told += [lasted_s] if stalls.is_news(found) else []
    assert told == [0.6, 2.0]


@pytest.fixture
def nodes(monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A robot of which two knees are nodes of one bus, and a hip is one of another."""
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 60_000_000_000)
    made, known = Bench(Desk()), described().description
    devices = {
        "left_knee": {"node_id": 2, "bus": "main"},
        "right_knee": {"node_id": 5, "bus": "main"},
        "right_hip": {"node_id": 4, "bus": "other"},
    }
    parts = [replace(one, device=devices.get(one.name, {})) for one in known.components]
    made.add("exo-01").take([Described(replace(known, components=parts)), walking(50), looked()])
    return made


def misses(bench: Bench, *silent: str) -> None:
    """The right knee reports a heartbeat that has not come; no value comes of these."""
    at_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {
        f"{joint}.{quantity}": [None]
        for joint in silent
        for quantity in ("position", "velocity", "torque", "current", "temperature", "state")
    }
    fault: QualityInfo = {"state": "fault", "age_ms": 1.0, "problem": f"the drive is in fault: {MISSED}"}
    whole = looked()
    snapshot = Snapshot(0, {}, {}, {"right_knee": fault})
    bench.look_again([telemetry([at_ns], columns, at_ns), Looked(snapshot, whole.parameters, whole.at_ns)])


MISSED = "0x8130 life guard or heartbeat error"


def test_a_node_that_is_silent_leads_from_the_frame_in_which_another_one_misses_it(nodes: Bench) -> None:
    """For a second the alarm led with what the other one reports: the robot calls the silent one ok still."""
    misses(nodes, "left_knee", "right_hip")
    station = nodes.station
    (one,) = station.alarms.active
    assert (one.alarm.kind, one.alarm.subject) == (Kind.PART_STALE, "left_knee")
    assert one.alarm.line == "component silent: left knee, node 2 on main: nothing comes from it"
    assert [under.subject for under in one.alarm.under] == ["right_knee"]
    assert one.alarm.mark.colour == "bad"
    assert station.mark.word == "left knee silent"
    assert one.alarm.clears, "the fault of the other one has to be cleared"


def test_where_the_silent_node_is_not_known_the_alarm_says_what_it_means(nodes: Bench) -> None:
    misses(nodes)
    (one,) = nodes.station.alarms.active
    assert one.alarm.line == (
        f"fault: right knee, node 5 on main: a node that it listens to is silent ({MISSED})"
    )


def test_a_node_without_values_is_silent_only_where_another_one_misses_it(nodes: Bench) -> None:
    at_ns = time.monotonic_ns()
    nodes.look_again([telemetry([at_ns], {"left_knee.position": [None]}, at_ns)])
    assert nodes.station.alarms.active == ()
