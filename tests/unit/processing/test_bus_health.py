"""How bad a bus is: a full one is an alarm, and one that nobody has looked at is not known."""

import time

import pytest
from msgspec.structs import replace

from drivers.bus.health import BUSY_NO_MORE
from gateway.client import ConnectionState
from gateway.wire.bus import CLOSED, BusInfo, NodeInfo, TalkInfo
from gateway.wire.finding import FindingInfo
from server_gui.core.follow.events import BusesSeen, LinkChanged
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.bus_health import (
    NO_MORE_PERCENT,
    TAKEN,
    BusHealthLevel,
    findings,
    level,
    rated,
    seen,
    trouble,
    worst,
)
from server_gui.core.processing.bus_senders import fewer

NODE = NodeInfo(2, ["left_knee"], 0.44, 12.0, 88, 0, 0, 0.0)
TALKS = [TalkInfo("TPDO", 2, 900.0), TalkInfo("SYNC", None, 100.0), TalkInfo("heartbeat", 2, 10.0)]
BUS = BusInfo("main", "error active", 1_000_000, 41.2, 1010.0, 0, 0, 1, 0, [NODE], None, [], TALKS)
BUSY = FindingInfo(1, "85 % of its time is taken", "send fewer PDOs")
LOST = FindingInfo(1, "it answers no SDO", "check its cable")
STOOD = "this computer stood still 2 times, for up to 0.5 s"


def robot(*buses: BusInfo, at_ns: int | None = None) -> Robot:
    made = Robot()
    made.apply(LinkChanged(ConnectionState.CONNECTED, None, 0))
    made.apply(BusesSeen(buses, time.monotonic_ns() if at_ns is None else at_ns))
    return made


@pytest.mark.parametrize(
    ("bus", "bad"),
    [
        (BUS, BusHealthLevel.GOOD),
        (replace(BUS, load_percent=None), BusHealthLevel.UNKNOWN),
        (replace(BUS, load_percent=100.0), BusHealthLevel.ALARM),
        (replace(BUS, load_percent=104.7), BusHealthLevel.ALARM),
        (replace(BUS, load_percent=85.0, findings=[BUSY]), BusHealthLevel.WARNING),
        (replace(BUS, state="error passive"), BusHealthLevel.WARNING),
        (replace(BUS, state="bus off"), BusHealthLevel.ALARM),
        (replace(BUS, state=CLOSED, load_percent=None), BusHealthLevel.ALARM),
        (replace(BUS, nodes=[replace(NODE, findings=[LOST])]), BusHealthLevel.WARNING),
        (replace(BUS, nodes=[replace(NODE, pdos_missing_percent=20.0)]), BusHealthLevel.WARNING),
    ],
)
def test_a_bus_is_as_bad_as_what_is_worst_of_it(bus: BusInfo, bad: BusHealthLevel) -> None:
    assert level(bus) is bad


def test_a_full_bus_is_an_alarm_that_says_what_to_check() -> None:
    said = trouble(replace(BUS, load_percent=100.0))
    assert said is not None
    assert said[0] == "it is full: 100 % of its time is taken"
    assert "send fewer PDOs" in said[1]
    robots = replace(BUSY, words="97 % of its time is taken")
    assert trouble(replace(BUS, load_percent=100.0, findings=[robots])) == said
    assert trouble(BUS) is None
    missing = trouble(replace(BUS, nodes=[replace(NODE, pdos_missing_percent=20.0)]))
    assert missing is not None
    assert missing[0] == "left knee: 20 % of its PDOs are missing"


def test_what_is_old_or_never_came_or_is_of_a_link_that_is_gone_is_not_known() -> None:
    old = robot(BUS, at_ns=time.monotonic_ns() - 60 * 10**9)
    gone = robot(BUS)
    gone.apply(LinkChanged(ConnectionState.WAITING, "no route", 0))
    too_old = robot()
    too_old.apply(BusesSeen(None, time.monotonic_ns()))
    for each in (Robot(), old, gone, too_old):
        assert seen(each) is None
        assert worst(each)[0] is BusHealthLevel.UNKNOWN
        assert "%" not in worst(each)[1][0]


def test_a_bus_of_which_nothing_has_come_yet_is_not_said_to_have_no_errors() -> None:
    new = replace(BUS, load_percent=None, talks=[])
    assert worst(robot(new)) == (BusHealthLevel.UNKNOWN, (f"CAN {BUS.name} –", "CAN –"))
    bad, wordings = worst(robot(replace(new, state="error passive")))
    assert bad is BusHealthLevel.WARNING
    assert "error passive" in wordings[0]


def test_the_worst_bus_is_said_with_its_load_its_errors_and_who_talks_most() -> None:
    full = replace(BUS, name="legs", load_percent=97.0, error_frames=3, bus_offs=2)
    bad, wordings = worst(robot(BUS, full))
    assert bad is BusHealthLevel.ALARM
    why = "it is full"
    assert (
        wordings[0] == f"CAN legs 97 %, 3 errors, 2 × bus off: {why} · 90 % of its frames are from left knee"
    )
    assert wordings[-1] == "CAN 97 %: full"


def test_frames_of_no_node_are_said_to_take_most_of_a_bus() -> None:
    injected = TalkInfo("other", None, 9000.0)
    _, wordings = worst(robot(replace(BUS, load_percent=97.0, talks=[*BUS.talks, injected])))
    assert wordings[0].endswith(" · 90 % of its frames are from no known node")
    unlisted = TalkInfo("other", 12, 9000.0)
    _, wordings = worst(robot(replace(BUS, load_percent=24.0, talks=[*BUS.talks, unlisted])))
    assert wordings[0].endswith(" · 90 % of its frames are from node 12")


def test_a_bus_that_is_a_little_less_full_than_busy_says_until_when_it_is_called_so() -> None:
    """77 % was called busy beside a mark at 80 %."""
    was = FindingInfo(1, f"84 % {TAKEN}", "send fewer PDOs")
    found = findings(replace(BUS, load_percent=77.0, findings=[was]))
    assert [words for words, _ in found] == [f"it is busy, until below 70 %: 77 % {TAKEN}"]
    _, wordings = worst(robot(replace(BUS, load_percent=77.0, findings=[was])))
    assert wordings[-1] == "CAN 77 %: busy"
    assert NO_MORE_PERCENT == BUSY_NO_MORE, "as the gateway does it"


def test_what_fills_a_bus_is_named_by_its_identifiers() -> None:
    injected = TalkInfo("other", None, 9000.0, [0x7F0, 1 << 31 | 0x123, 1 << 30 | 0x182])
    found = fewer(replace(BUS, load_percent=97.0, talks=[*BUS.talks, injected]))
    assert "no known node (0x7F0, 0x182 (remote request), 0x00000123): find what sends them" in found


@pytest.mark.parametrize(
    ("bus", "why"),
    [
        (replace(BUS, load_percent=24.0, state="error passive"), "error passive"),
        (replace(BUS, load_percent=85.0), "busy"),
        (replace(BUS, load_percent=24.0, findings=[replace(BUSY, words=STOOD)]), "not read in time"),
        (replace(BUS, load_percent=24.0, nodes=[replace(NODE, pdos_missing_percent=3.0)]), "PDOs missing"),
        (replace(BUS, load_percent=24.0, nodes=[replace(NODE, findings=[LOST])]), "no answer"),
    ],
)
def test_a_bus_that_is_marked_says_why_in_every_wording(bus: BusInfo, why: str) -> None:
    _, wordings = worst(robot(bus))
    assert wordings[-1].endswith(f": {why}")
    assert all(": " in said for said in wordings)


def test_what_several_nodes_have_is_said_once() -> None:
    names = ("left_hip", "left_knee", "right_knee")
    nodes = [
        replace(NODE, node_id=place + 1, components=[name], pdos_missing_percent=3.0 + place)
        for place, name in enumerate(names)
    ]
    bus = replace(BUS, load_percent=24.0, nodes=nodes)
    assert findings(bus) == [("all 3 nodes: 3–5 % of their PDOs are missing", "")]
    well = replace(NODE, node_id=9, components=["right_hip"], pdos_missing_percent=0.0)
    whose = "left hip, left knee, right knee"
    assert findings(replace(bus, nodes=[*nodes, well])) == [(f"{whose}: 3–5 % of their PDOs are missing", "")]
    nodes.append(replace(nodes[0], node_id=4, components=["left_ankle"]))
    for others, whose in ((1, "all nodes but right hip"), (3, "left hip, left knee and 2 more nodes")):
        wells = [replace(well, node_id=9 + place) for place in range(others)]
        said = f"{whose}: 3–5 % of their PDOs are missing"
        assert findings(replace(bus, nodes=[*nodes, *wells])) == [(said, "")]
    lost = [replace(node, findings=[LOST]) for node in nodes[:2]]
    assert findings(replace(bus, nodes=[*lost, nodes[2]])) == [
        ("left hip, left knee: they answer no SDO", LOST.check),
        ("right knee: 5 % of its PDOs are missing", ""),
    ]


def test_where_no_node_answers_any_more_the_bus_fails() -> None:
    """It was a warning like that of one node, beside drives of which none was known."""
    nodes = [replace(NODE, node_id=place, findings=[LOST]) for place in (1, 2, 3)]
    bus = replace(BUS, nodes=nodes)
    assert level(bus) is BusHealthLevel.ALARM
    assert rated(bus) == [(BusHealthLevel.ALARM, "all 3 nodes: they answer no SDO", LOST.check)]
    well = replace(bus, nodes=[*nodes[:2], NODE])
    assert level(well) is BusHealthLevel.WARNING
    never_asked = replace(NODE, node_id=9, sdo_transfers=0, sdo_timeouts=0)
    assert level(replace(bus, nodes=[*nodes, never_asked])) is BusHealthLevel.ALARM, "it says nothing of them"


def test_a_count_that_grows_is_told_by_the_page_alone_and_each_finding_has_its_own_level() -> None:
    silent = FindingInfo(1, "it answers no SDO, 7 requests in a row", "switch it off and on")
    bus = replace(BUS, load_percent=100.0, nodes=[replace(NODE, findings=[silent])])
    assert rated(bus)[1] == (BusHealthLevel.WARNING, f"left knee: {silent.words}", silent.check)
    assert rated(bus)[0][0] is BusHealthLevel.ALARM
    assert (trouble(bus) or ("", ""))[0].endswith("left knee: it answers no SDO")
