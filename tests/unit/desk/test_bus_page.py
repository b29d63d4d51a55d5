"""The rows of the page Bus: what is silent shows nothing old, the worst is first, colours have reasons."""

import dataclasses

from msgspec.structs import asdict, replace

from gateway.wire.bus import BusInfo, NodeInfo, TalkInfo
from gateway.wire.finding import FindingInfo
from server_gui.core.alarms.alarm import Active, Alarm, Alarms
from server_gui.core.alarms.marks import STATES
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk.bus_page import BEFORE, Row, lines, rows, told_kinds
from server_gui.core.desk.stop_all import SENT, STOPPED
from server_gui.core.follow.missing_pdos import WatchedNode
from server_gui.core.follow.robot import FollowedComponent

HIP = NodeInfo(1, ["left_hip"], 0.4, 1.0, 88, 0, 0, 0.0)
KNEE = NodeInfo(2, ["left_knee"], 0.4, 12.0, 88, 6, 0, 8.3)
GAIT = NodeInfo(16, ["gait"], 0.4, 1.0, 88, 0, 0, None)
TALKS = [
    TalkInfo("TPDO", 1, 325.4),
    TalkInfo("RPDO", 1, 100.4),
    TalkInfo("RPDO", 2, 100.4),
    TalkInfo("SYNC", None, 100.4),
    TalkInfo("SDO answer", 16, 10.4),
]
BUS = BusInfo("main", "error active", 1_000_000, 22.0, 700.0, 0, 0, 1, 0, [HIP, KNEE, GAIT], None, [], TALKS)
GONE = "its heartbeat has been missing for 1.3 s: check the node's power and cable"
PARTS = {
    "left_hip": FollowedComponent("left_hip", "joint", "ok", 5.0, None),
    "left_knee": FollowedComponent("left_knee", "joint", "lost", 1300.0, GONE),
    "gait": FollowedComponent("gait", "gait", "ok", 5.0, None),
}
LOST = Alarm(Kind.LOST, "left_knee", "its heartbeat has been missing for 1.3 s", "left knee", node="main")


def told(*alarms: Alarm) -> Alarms:
    made = Alarms()
    made.look(alarms, 100.0)
    return made


def by_name(found: list[Row]) -> dict[str, Row]:
    return {row.name: row for row in found}


def test_a_silent_node_says_for_how_long_and_has_no_old_average() -> None:
    knee = by_name(rows(BUS, PARTS, told(LOST), live=True))["left knee"]
    assert knee.frames == "silent 1.3 s"
    assert (knee.share, knee.trips, knee.missing, knee.sends) == ("–", "–", "–", "")
    assert knee.unanswered == "6"


def test_without_a_word_of_its_heartbeat_it_is_silent_since_its_newest_sample() -> None:
    old = dataclasses.replace(
        PARTS["left_knee"], state="stale", problem="no new sample for 0.9 s", age_ms=900.0
    )
    parts = {**PARTS, "left_knee": old}
    assert by_name(rows(BUS, parts, told(), live=True))["left knee"].frames == "silent 900 ms"
    sends = replace(BUS, talks=[*TALKS, TalkInfo("TPDO", 2, 300.0)], frames_per_s=1000.0)
    assert by_name(rows(sends, parts, told(), live=True))["left knee"].frames.isdigit()


def test_one_that_sends_without_its_heartbeat_is_not_called_silent() -> None:
    sends = replace(BUS, talks=[*TALKS, TalkInfo("TPDO", 2, 300.0)], frames_per_s=1000.0)
    found = by_name(rows(sends, PARTS, told(LOST), live=True))
    assert found["left knee"].frames == "no heartbeat 1.3 s"
    assert found[BEFORE].frames == "300"


def test_the_worst_node_stands_first() -> None:
    busy = replace(BUS, nodes=[HIP, KNEE, replace(GAIT, findings=[FindingInfo(1, "it answers no SDO", "")])])
    found = rows(busy, PARTS, told(LOST), live=True)
    assert [(row.name, row.colour) for row in found[:3]] == [
        ("left knee", "bad"),
        ("gait", "warn"),
        ("left hip", "text"),
    ]


def test_missing_pdos_have_a_mark_of_their_own() -> None:
    """It was that of a STOP that is confirmed."""
    missing = replace(BUS, nodes=[replace(HIP, pdos_missing_percent=4.0), KNEE, GAIT])
    mark = by_name(rows(missing, PARTS, told(), live=True))["left hip"].mark
    assert mark is not None
    assert (mark.word, mark.colour) == ("PDOs missing", "warn")
    for percent, told_percent, said in (
        (1.9, 0.0, "1.9 %, for now"),
        (1.9, 1.9, "1.9 %"),
        (0.4, 0.0, "0.4 %"),
    ):
        hip = WatchedNode(**asdict(HIP), told_percent=told_percent)
        seen = replace(BUS, nodes=[replace(hip, pdos_missing_percent=percent), KNEE, GAIT])
        assert by_name(rows(seen, PARTS, told(), live=True))["left hip"].missing == said
    assert mark.shape not in (STOPPED.shape, SENT.shape, STATES["ok"].shape)


def test_what_fills_a_busy_bus_stands_before_what_suffers_from_it() -> None:
    """71 % of the frames stood seventh and in black below six nodes that missed 1.5 %."""
    injected = TalkInfo("other", None, 5560.0, [0x7FF])
    missing = replace(HIP, pdos_missing_percent=1.5)
    busy = replace(
        BUS, load_percent=90.0, frames_per_s=6260.0, talks=[injected, *TALKS], nodes=[missing, GAIT]
    )
    first, second, *_ = rows(busy, PARTS, told(), live=True)
    assert (first.name, first.ids, first.colour) == ("no known node", "0x7FF", "warn")
    assert first.mark is not None
    assert first.mark.word == "most of the load"
    assert (second.name, second.colour) == ("left hip", "warn")
    full = by_name(rows(replace(busy, load_percent=99.0), PARTS, told(), live=True))["no known node"]
    assert full.colour == "bad"
    quiet = by_name(rows(replace(busy, load_percent=20.0), PARTS, told(), live=True))["no known node"]
    assert quiet.mark is None


def test_a_silent_cause_stands_before_what_comes_of_it() -> None:
    unreliable = Alarm(Kind.FAULT, "gait", "it reports 0x8130", "gait")
    names = [row.name for row in rows(BUS, PARTS, told(unreliable, LOST), live=True)]
    assert names[:2] == ["left knee", "gait"]


def test_a_cause_that_only_others_have_missed_yet_stands_first_with_its_time() -> None:
    """It stood below the gait controller, which is unreliable by it, with – for its time."""
    parts = {
        **PARTS,
        "left_knee": dataclasses.replace(PARTS["left_knee"], state="ok", age_ms=300.0, problem=None),
    }
    unreliable = Alarm(Kind.IMPLAUSIBLE, "gait", "a node that it listens to is silent", "gait", node="main")
    missed = Alarm(
        Kind.PART_STALE, "left_knee", "nothing comes", "left knee", node="main", under=(unreliable,)
    )
    first, second, *_ = rows(BUS, parts, told(missed), live=True)
    assert (first.name, second.name) == ("left knee", "gait")
    assert first.frames in ("silent 300 ms", "for 300 ms")


def test_of_many_identifiers_the_lowest_and_the_highest_are_told_and_never_only_some() -> None:
    """Six drives' RPDOs were told as four."""
    rpdos = [TalkInfo("RPDO", node, 100.0, [0x200 + node]) for node in range(1, 7)]
    cut = TalkInfo("TPDO", 9, 400.0, [0x189, 0x289, 0x389, 0x489])
    found = by_name(rows(replace(BUS, talks=[*rpdos, cut], frames_per_s=1000.0), PARTS, told(), live=True))
    assert found["RPDO"].ids == "0x201 … 0x206"
    assert found["not in the file"].ids == "0x189, 0x289, 0x389, 0x489, …"


def test_shown_frames_add_up_to_the_bus_with_silent_nodes_too() -> None:
    for talks in (TALKS, [*TALKS, TalkInfo("heartbeat", 2, 12.4)]):
        bus = replace(BUS, talks=talks)
        numbers = [int(row.frames) for row in rows(bus, PARTS, told(LOST), live=True) if row.frames.isdigit()]
        assert sum(numbers) == 700
        assert sum(int(said.split(" (")[0].rsplit(" ", 1)[1]) for said in told_kinds(bus)) == 700


def test_kinds_have_their_share() -> None:
    assert told_kinds(BUS)[0] == "TPDO 325 (46 %)"


def test_each_colour_of_a_row_has_its_reason_in_a_line_and_in_the_row() -> None:
    """Also of what another alarm explains."""
    gait = Alarm(Kind.PART_STALE, "gait", "no new sample for 1.1 s", "gait", node="main")
    alarms = told(dataclasses.replace(LOST, under=(gait,)))
    found = by_name(rows(BUS, PARTS, alarms, live=True))
    assert found["gait"].mark is not None
    assert (found["gait"].colour, found["gait"].mark.word) == ("warn", "component stale")
    said = [line for _, line in lines([BUS], alarms)]
    assert said[0] == LOST.line
    assert gait.line in said


def test_many_that_one_alarm_explains_are_named_in_one_line() -> None:
    names = [f"joint_{number}" for number in range(4)]
    bus = replace(
        BUS, nodes=[replace(HIP, node_id=9 + place, components=[one]) for place, one in enumerate(names)]
    )
    under = tuple(Alarm(Kind.PART_STALE, one, "old", one.replace("_", " ")) for one in names)
    stood = Alarm(Kind.STALLED, "", "it stood still for 0.6 s", "robot's computer", under=under)
    assert [line for _, line in lines([bus], told(stood))][-1] == (
        "component stale: joint 0, joint 1, joint 2, joint 3"
    )


def test_a_bus_is_told_of_in_its_alarms_own_line_before_and_after_it_is_found() -> None:
    full = replace(BUS, nodes=[HIP], load_percent=100.0)
    line = "bus full: main: 100 % of its time is taken"
    assert lines([full], told()) == [(True, line)]
    alarm = Alarm(Kind.BUS_FULL, "bus.main", "100 % of its time is taken", "main")
    assert Active(alarm, 0.0).alarm.line == line
    assert lines([full], told(alarm)) == [(True, line)]


def test_a_node_of_which_nothing_is_known_is_not_ok() -> None:
    unheard = replace(GAIT, node_id=7, components=["insole"], sdo_p50_ms=None)
    found = by_name(rows(replace(BUS, nodes=[HIP, unheard]), PARTS, told(), live=True))
    marks = {name: found[name].mark for name in ("left hip", "insole")}
    assert {name: mark.word for name, mark in marks.items() if mark is not None} == {
        "left hip": "ok",
        "insole": "not known",
    }
    assert found["insole"].frames == "–"
