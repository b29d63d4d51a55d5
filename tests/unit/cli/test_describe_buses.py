"""`gwrms describe` shows buses, nodes, the last emergency messages, and what was found where, once each."""

from typing import Any

import msgspec
import pytest

from gateway.cli import describe
from gateway.cli.describe_buses import chapters
from gateway.cli.text import PAGE
from gateway.wire.bus import CLOSED, BusInfo, NodeInfo, TalkInfo
from gateway.wire.component import ComponentInfo, EmcyInfo
from gateway.wire.finding import FindingInfo
from gateway.wire.robot import Clock, Description, GuardInfo
from gateway.wire.stop import StopInfo

SECOND_NS = 1_000_000_000
SILENT = FindingInfo(90 * SECOND_NS, "it answers no SDO, 9 requests in a row", "is another client there?")
FULL = FindingInfo(98 * SECOND_NS, "93 % of its time is taken", "send fewer PDOs")
FROZEN = FindingInfo(97 * SECOND_NS, "its position stays the same", "check its encoder")
NODE = NodeInfo(2, ["left_knee"], 0.44, 12.0, 88, 3, 1, 20.1, [SILENT])
BUS = BusInfo("main", "error active", 1_000_000, 93.2, 7800.0, 5, 0, 1, 0, [NODE], None, [FULL])
KNEE = ComponentInfo(
    "left_knee",
    "joint",
    "fault",
    "…",
    findings=[FROZEN, SILENT],
    emcy=EmcyInfo(40 * SECOND_NS, 0x8611, "0x8611 following error too large", active=False),
)


def described(*buses: BusInfo) -> Description:
    stop = StopInfo(held=False, reason=None, since_ns=None, stopped_again={}, drives={})
    clock = Clock(100 * SECOND_NS, 0, "boot")
    return Description(
        "exo", "boot", "observer", [KNEE], [], [], {}, clock, stop, GuardInfo(), buses=list(buses)
    )


def test_the_tables_show_each_thing_once() -> None:
    shown = "\n".join(chapters(described(BUS)))
    rows = [" ".join(line.split()) for line in shown.splitlines()]
    assert "main error active 93.2 % 7800 5 0 0" in rows
    assert "main 2 left_knee 0.4 ms 12.0 ms 88 3 1 20.1 %" in rows
    assert "left_knee 0x8611 following error too large 60 s taken back" in rows
    assert "main 2 s 93 % of its time is taken send fewer PDOs" in rows
    assert shown.count("it answers no SDO") == 1
    assert (
        "main node 2 (left_knee) 10 s it answers no SDO, 9 requests in a row is another client there?" in rows
    )
    assert "left_knee 3 s its position stays the same check its encoder" in rows


def test_who_is_heard_and_is_in_no_table_is_named() -> None:
    shown = "\n".join(chapters(described(msgspec.structs.replace(BUS, strangers=[9, 21]))))
    assert "no table of the file has what is heard on main as node 9, 21: give it one" in shown


def test_a_robot_of_before_has_no_such_tables() -> None:
    text = msgspec.json.encode(described())
    old = {key: value for key, value in msgspec.json.decode(text).items() if key != "buses"}
    for part in old["components"]:
        del part["findings"], part["emcy"]
    assert list(chapters(msgspec.convert(old, Description))) == []


class Cold:
    """A robot whose buses have just been opened."""

    def __init__(self, *answers: BusInfo) -> None:
        self.answers = [described(one) for one in answers]

    def describe(self) -> Description:
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


def test_a_bus_that_has_just_been_opened_is_measured_first(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    monkeypatch.setattr("gateway.cli.describe.time.sleep", slept.append)
    fresh = msgspec.structs.replace(BUS, load_percent=None, frames_per_s=None)
    robot: Any = Cold(fresh, fresh, BUS)
    assert describe._measured(robot).buses == [BUS]
    assert len(slept) == 2
    closed = msgspec.structs.replace(fresh, state=CLOSED)
    robot = Cold(closed)
    assert describe._measured(robot).buses == [closed], "what is not open is not waited for"


def test_an_overloaded_bus_says_so_in_its_own_row() -> None:
    busy = msgspec.structs.replace(BUS, load_percent=101.0)
    row = next(chapter for chapter in chapters(described(busy)) if "LOAD" in chapter)
    assert "the bus is overloaded: 101 % of its time is taken" in row
    other = next(chapter for chapter in chapters(described(BUS)) if "LOAD" in chapter)
    assert "overloaded" not in other


TALKS = [
    TalkInfo("other", None, 5210.4, [0x7FF, 0x18FF00E5 | 1 << 31]),
    TalkInfo("TPDO", 2, 800.0, [0x182, 0x282, 0x382, 0x482]),
    TalkInfo("RPDO", 2, 400.0, [0x202]),
    TalkInfo("SDO request", 9, 300.0, [0x609]),
    TalkInfo("SYNC", None, 200.0, [0x080]),
    TalkInfo("heartbeat", 2, 10.0, [0x702]),
]


def test_a_busy_bus_names_the_identifiers_that_take_its_time_and_whose_they_are() -> None:
    busy = msgspec.structs.replace(BUS, talks=TALKS)
    told = next(chapter for chapter in chapters(described(busy)) if chapter.startswith("on main: "))
    assert max(map(len, told.splitlines())) <= PAGE
    assert " ".join(told.split()) == (
        "on main: no known node 0x7FF, 0x18FF00E5: 5210 frames/s; "
        "TPDO of left_knee 0x182, 0x282, 0x382, 0x482, …: 800 frames/s; "
        "RPDO to left_knee 0x202: 400 frames/s; "
        "SDO request to node 9 0x609: 300 frames/s; SYNC 0x080: 200 frames/s; and 1 more"
    )


def test_a_bus_with_room_names_none() -> None:
    for free in (msgspec.structs.replace(BUS, talks=TALKS, load_percent=40.0), BUS):
        assert "on main: " not in "\n".join(chapters(described(free)))
