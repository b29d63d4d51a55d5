"""Trouble of a bus is told where it begins and where it becomes worse, and anew once it was over."""

from typing import Any

import pytest
from msgspec.structs import replace

from gateway.wire.bus import CLOSED, BusInfo
from gateway.wire.finding import FindingInfo
from server_gui.core.processing.bus_turns import OVER_NS, BusTurns
from tests.unit.processing.test_bus_health import BUS

S = 1_000_000_000
FINE: dict[str, Any] = {}
WARNED: dict[str, Any] = {"state": "error passive"}
OFF: dict[str, Any] = {"state": "bus off"}
FULL: dict[str, Any] = {"load_percent": 99.0}
FULL_SAID = "main: it is full: 99 % of its time is taken"


def bus(**now: Any) -> BusInfo:
    return replace(BUS, **now)


def told(*looks: tuple[int, dict[str, Any] | None]) -> list[list[str]]:
    """Return what each look tells: when, and what is so of the bus; None: nobody knows."""
    turns = BusTurns()
    return [turns.take(None if now is None else [bus(**now)], at_ns) for at_ns, now in looks]


def test_it_is_told_once_while_it_lasts_and_again_where_it_becomes_worse() -> None:
    assert told((0, FINE), (S, WARNED), (2 * S, WARNED), (3 * S, OFF), (4 * S, OFF), (5 * S, WARNED)) == [
        [],
        ["main: error passive"],
        [],
        ["main: bus off"],
        [],
        [],
    ]


def test_the_worst_of_what_is_wrong_is_how_bad_it_is() -> None:
    finding = {"findings": [FindingInfo(1, "12 errors", "check its cable")]}
    assert told((0, finding), (S, finding | WARNED), (2 * S, finding | OFF), (3 * S, finding | OFF)) == [
        ["main: 12 errors"],
        [],
        ["main: bus off; 12 errors"],
        [],
    ]


def test_it_is_over_after_ten_seconds_without_it_and_not_before() -> None:
    assert OVER_NS == 10 * S
    over = told((0, OFF), (OVER_NS, FINE), (OVER_NS + 1, OFF))
    assert over == [["main: bus off"], [], ["main: bus off"]]
    lasting = told((0, OFF), (OVER_NS - 1, FINE), (OVER_NS, OFF), (2 * OVER_NS - 1, FINE), (2 * OVER_NS, OFF))
    assert lasting == [["main: bus off"], [], [], [], []], "it counts from when it was so last"


def test_a_look_that_knows_nothing_ends_nothing() -> None:
    assert told((0, OFF), (60 * S, None), (61 * S, OFF)) == [["main: bus off"], [], []]


def test_a_clock_that_goes_back_tells_nothing_twice_and_makes_nothing_last() -> None:
    """What was seen at a later time lasted until the clock was there again."""
    hour = 3600 * S
    assert told((hour, OFF), (0, OFF), (S, OFF)) == [["main: bus off"], [], []]
    assert told((hour, OFF), (0, FINE), (OVER_NS - 1, FINE), (OVER_NS - 1, OFF))[-1] == []
    assert told((hour, OFF), (0, FINE), (OVER_NS, FINE), (OVER_NS + 1, OFF))[-1] == ["main: bus off"]


def test_its_load_and_everything_else_begin_and_end_apart() -> None:
    assert told((0, FULL), (S, FULL | OFF), (2 * S, FULL | OFF)) == [[FULL_SAID], ["main: bus off"], []]
    both = told((0, FULL | OFF), (OVER_NS, OFF), (OVER_NS + 1, FULL | OFF))
    assert both == [[FULL_SAID, "main: bus off"], [], [FULL_SAID]]


@pytest.mark.parametrize(("percent", "is_told"), [(80.0, False), (94.9, False), (95.0, True), (100.0, True)])
def test_a_busy_bus_is_no_trouble_until_it_is_full(percent: float, is_told: bool) -> None:
    assert bool(told((0, {"load_percent": percent}))[0]) is is_told


def test_a_bus_that_nobody_uses_is_no_trouble_unless_it_says_why() -> None:
    closed = {"state": CLOSED, "problem": None}
    assert told((0, closed)) == [[]]
    assert told((0, closed | {"problem": "no such interface"})) == [["main: no such interface; closed"]]
    finding = FindingInfo(1, "12 errors", "check its cable")
    assert told((0, closed | {"findings": [finding]})) == [[]]


def test_buses_are_told_apart() -> None:
    turns = BusTurns()
    both = [bus(**OFF), replace(bus(**FINE), name="feet")]
    assert turns.take(both, 0) == ["main: bus off"]
    assert turns.take([both[0], replace(both[1], **OFF)], S) == ["feet: bus off"]
