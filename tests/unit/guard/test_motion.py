"""Where a joint would come to rest, whether it moves while it is held, left against right over strides."""

import math
import time
from collections.abc import Callable
from typing import Any

import pytest

from drivers.component import ComponentKind
from gateway.guard.watcher import GRACE_NS
from gateway.guard.watcher import RuleState as Found
from gateway.guard.wiring import Wiring
from tests.unit.guard.bench import Bench, Part, S

SIDES = {"left": "left_knee", "right": "left_hip", "quantity": "position", "above": 0.1}
BRAKE = {"max": 2.0, "deceleration": 5.0}


@pytest.mark.parametrize(
    ("keys", "position", "velocity", "trips"),
    [
        (BRAKE, 1.6, 2.0, False),  # at rest at exactly 2 rad
        (BRAKE, 1.61, 2.0, True),
        (BRAKE, 1.7, -2.0, False),  # it goes the other way
        (BRAKE, 2.1, -2.0, False),  # beyond it, and on its way back
        (BRAKE, 2.1, -0.5, True),  # too slowly
        (BRAKE, -99.0, -9.0, False),  # there is no limit there
        ({"min": -1.0, "deceleration": 5.0}, -0.59, -2.0, False),
        ({"min": -1.0, "deceleration": 5.0}, -0.61, -2.0, True),
        ({**BRAKE, "reaction_s": 0.1}, 1.4, 2.0, False),
        ({**BRAKE, "reaction_s": 0.1}, 1.41, 2.0, True),
    ],
)
def test_what_would_come_to_rest_beyond_its_limit_trips(
    bench: Bench, keys: dict[str, Any], position: float, velocity: float, trips: bool
) -> None:
    bench.wire("stopping_distance", on=["left_knee"], **keys).open()
    bench.knee.give("position", position)
    assert not bench.changes, "its velocity is not known"
    bench.knee.give("velocity", velocity)
    assert bench.states() == [Found.TRIPPED] * trips


def test_where_it_would_come_to_rest_is_unknown_without_one_of_both(bench: Bench) -> None:
    wiring = bench.wire("stopping_distance", on=["left_knee"], **BRAKE)
    (watcher,) = wiring.watchers
    wiring.open()
    for velocity, position in ((1.0, 1.0), (None, 1.95)):
        if velocity is not None:
            bench.knee.give("velocity", velocity, 10 * S)
        bench.knee.give("position", position, 10 * S + (500_000_001 if velocity is None else 0))
    assert not bench.changes, "an old velocity stops nothing"
    watcher.look(10 * S + 500_000_000)
    assert not bench.changes
    watcher.look(10 * S + 500_000_001)
    assert bench.states() == [Found.BLIND]


@pytest.mark.parametrize("value", [None, math.nan, math.inf])
def test_what_is_no_number_makes_no_stopping_point(bench: Bench, value: float | None) -> None:
    bench.wire("stopping_distance", on=["left_knee"], **BRAKE).open()
    bench.knee.give("velocity", 1.0)
    bench.knee.give("position", value)
    assert not bench.changes
    bench.knee.give("position", 2.0)
    assert bench.states() == [Found.TRIPPED]


def test_an_old_velocity_counts_as_long_as_it_is_not_stale(bench: Bench) -> None:
    bench.wire("stopping_distance", on=["left_knee"], **BRAKE).open()
    bench.knee.give("velocity", 1.0, 10 * S)
    bench.knee.give("position", 1.95, 10 * S + 500_000_000)
    assert bench.states() == [Found.TRIPPED]
    assert bench.changes[0].reason == ("left_knee: 2.05 rad, at rest only above 2 rad, braking by 5 rad/s²")


@pytest.mark.parametrize(("on", "problems"), [(None, []), (["left_hip"], ["left_hip: has no velocity"])])
def test_a_drive_without_a_velocity_has_no_stopping_distance(
    bench: Bench, on: list[str] | None, problems: list[str]
) -> None:
    bench.hip = Part("left_hip", ComponentKind.JOINT, ("position",))
    for watcher in bench.wire("stopping_distance", **BRAKE, **({} if on is None else {"on": on})).watchers:
        watcher.look(1)
    assert [one.reason for one in bench.changes] == problems


def test_a_drift_counts_from_when_the_stop_has_settled_and_then_from_where_it_was_said(bench: Bench) -> None:
    bench.wire("drift_while_held", on=["left_knee"], above=0.125, settle_s=1.0, clear_s=0.1).open()
    now_ns = time.monotonic_ns()

    def give(at_ms: int, position: float) -> list[Found]:
        bench.knee.give("position", position, now_ns + at_ms * 1_000_000)
        return bench.states()

    assert give(0, 0.0) == give(10, 5.0) == [], "it walks"
    bench.held = True
    for at_ms, position in ((20, 5.0), (500, 9.0), (1019, 9.5)):  # it brakes
        assert give(at_ms, position) == []
    for at_ms, position in ((1020, 2.0), (1500, 2.125), (1600, 1.875)):
        assert give(at_ms, position) == []
    assert give(1700, 2.25) == [Found.TRIPPED]
    assert bench.changes[0].reason == (
        "left_knee.position: 0.25 rad, moved more than 0.125 rad, from 1 s after a stop on"
    )
    assert give(1800, 2.375) == give(1899, 2.125) == [Found.TRIPPED]
    assert give(1900, 2.25) == [Found.TRIPPED, Found.CLEARED], "it rests where it was said to be"
    assert give(2000, 2.0) == [Found.TRIPPED, Found.CLEARED, Found.TRIPPED]
    bench.held = False
    give(2100, 7.0)
    assert give(2200, 8.0)[-1] is Found.CLEARED
    bench.held = True
    before = give(2300, 8.0)
    assert give(3300, 9.0) == give(3400, 9.125) == before, "a new stop has a reference of its own"
    assert give(3500, 9.25)[-1] is Found.TRIPPED


def window(
    bench: Bench, keys: dict[str, Any], left: Callable[[int], float], right: Callable[[int], float]
) -> Wiring:
    """Both sides for so many hundredths of a second."""
    wiring = bench.wire("asymmetry", **{**SIDES, **keys})
    wiring.open()
    for at in range(220):
        bench.knee.give("position", left(at), 10 * S + at * 10_000_000)
        bench.hip.give("position", right(at), 10 * S + at * 10_000_000)
    return wiring


def step(at: int) -> float:
    """A joint that swings by 0.5 rad in 0.4 s."""
    return 0.5 * (at % 40 < 20)


@pytest.mark.parametrize(
    ("keys", "left", "right", "trips"),
    [
        ({}, step, lambda at: step(at + 20), False),  # antiphase, as legs are
        ({}, step, lambda at: 0.85 * step(at + 20), False),
        ({}, step, lambda at: 0.79 * step(at + 20), True),
        ({}, lambda at: 0.79 * step(at), lambda at: step(at + 20), True),
        ({}, step, lambda at: 7.0 + step(at + 20), False),  # elsewhere, but as far
        ({"of": "mean"}, step, lambda at: 0.09 + step(at + 20), False),
        ({"of": "mean"}, step, lambda at: 0.11 + step(at + 20), True),
        (
            {"of": "mean"},
            step,
            lambda at: 3 * (step(at) - 0.25) + 0.25,
            False,
        ),  # further, but around the same
    ],
)
def test_left_and_right_are_compared_over_strides(
    bench: Bench,
    keys: dict[str, Any],
    left: Callable[[int], float],
    right: Callable[[int], float],
    trips: bool,
) -> None:
    window(bench, {"window_s": 1.6, **keys}, left, right)
    assert bench.states() == [Found.TRIPPED] * trips


def test_an_asymmetry_says_what_differs(bench: Bench) -> None:
    window(bench, {"window_s": 1.6, "for_s": 0.1}, step, lambda at: 0.5 * step(at))
    limit = "range of position over 1.6 s differs by more than 0.1 rad for 0.1 s"
    assert bench.changes[0].reason == f"left_knee and left_hip: 0.25 rad, {limit}"


def test_a_window_takes_its_time_before_it_is_called_blind(bench: Bench) -> None:
    (watcher,) = bench.wire("asymmetry", **SIDES, window_s=2.0).watchers
    watcher.look(GRACE_NS + 2 * S)
    assert not bench.changes
    watcher.look(GRACE_NS + 2 * S + 1)
    assert [one.reason for one in bench.changes] == ["left_knee and left_hip: has had no value yet"]


def test_one_side_alone_is_blind(bench: Bench) -> None:
    wiring = window(bench, {"window_s": 1.6}, step, step)
    (watcher,) = wiring.watchers
    last_ns = 10 * S + 219 * 10_000_000
    for at in range(1, 61):
        bench.knee.give("position", step(at), last_ns + at * 10_000_000)
    watcher.look(last_ns + 500_000_000)
    assert not bench.changes
    watcher.look(last_ns + 500_000_001)
    assert bench.states() == [Found.BLIND]


def test_a_side_that_is_not_there_or_cannot_tell_is_said(bench: Bench) -> None:
    bench.absent["left_hip"] = (ComponentKind.JOINT, "its EDS is broken")
    for watcher in bench.wire("asymmetry", **SIDES).watchers:
        watcher.look(1)
    bench.absent = {"left_knee": (ComponentKind.JOINT, "its EDS is worse")}
    for watcher in bench.wire("asymmetry", **SIDES).watchers:
        watcher.look(1)
    bench.absent = {}
    bench.hip = Part("left_hip", ComponentKind.JOINT, ("velocity",))
    for watcher in bench.wire("asymmetry", **SIDES).watchers:
        watcher.look(1)
    assert [one.reason for one in bench.changes] == [
        "left_hip: is not there: its EDS is broken",
        "left_knee: is not there: its EDS is worse",
        "left_hip: has no position",
    ]
