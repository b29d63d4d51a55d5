"""The trigger: what triggers it, what a mode does then, and what nothing is made of."""

import math

import numpy as np
import pytest

from server_gui.core.workspace.trigger import Condition, Mode, On, Trigger, TriggerState

NAN = math.nan


@pytest.mark.parametrize(
    ("on", "values", "row"),
    [
        (On.RISE, [0, 1, 3], 2),
        (On.RISE, [3, 1, 3], 2),
        (On.RISE, [3, 3, 3], None),  # it is above, and has not risen
        (On.RISE, [0, NAN, 3], None),  # nobody saw it rise
        (On.FALL, [3, 3, 1], 2),
        (On.FALL, [1, 1, 0], None),
        (On.ABOVE, [3, 3, 3], 0),
        (On.ABOVE, [NAN, 1, NAN], None),
        (On.BELOW, [3, 3, 1], 2),
        (On.BELOW, [NAN, NAN], None),
        (On.ENTERS, [0, 3, 5], 1),
        (On.ENTERS, [3, 3], None),
        (On.LEAVES, [3, 3, 5], 2),
        (On.LEAVES, [3, NAN, 5], None),
        (On.EMCY, [0, 0, 0x7300], 2),
        (On.EMCY, [0x7300, 0x7300, 0], None),  # it is over
        (On.EMCY, [0x7300, 0x8611], 1),  # another one
        (On.EMCY, [NAN, 0x7300], None),  # nobody knows since when
    ],
)
def test_what_triggers(on: On, values: list[float], row: int | None) -> None:
    trigger = Trigger()
    trigger.arm(Condition(on, "x", level=2.0, high=4.0, before=1.0), None)
    for end in range(1, len(values) + 1):  # as rows come, one by one
        shown = trigger.take(np.arange(float(end)), np.array(values[:end], float), 1.0)
        assert shown is (row == end - 1)
        if shown:
            break
    assert trigger.at_s == (None if row is None else float(row))


@pytest.mark.parametrize("armed_s", [0.0, 1.0])
def test_an_edge_right_after_it_was_armed_is_seen(armed_s: float) -> None:
    """What it begins from came before; what leads to it is news."""
    values = np.array([0.0, 0.0, 3.0] if armed_s else [0.0, 3.0])
    trigger = Trigger()
    trigger.arm(Condition(On.RISE, "x", level=2.0, before=1.0), armed_s)
    assert trigger.take(np.arange(float(len(values))), values, 1.0)
    assert trigger.at_s == armed_s + 1.0


def run(
    mode: Mode, hold_off_s: float = 0.0, before: float = 0.5, seconds: float = 20.0
) -> list[tuple[float, TriggerState]]:
    """A pulse at 5 s, 10 s, 15 s; span 2 s; how its state changes, and when."""
    trigger = Trigger()
    trigger.arm(Condition(On.RISE, "x", 0.5, mode=mode, hold_off_s=hold_off_s, before=before), 0.0)
    times = np.arange(0.0, seconds, 0.1)
    values = (times % 5.0 < 0.35).astype(float)
    states = [(0.0, trigger.state)]
    for end in range(1, len(times) + 1):
        trigger.take(times[:end], values[:end], 2.0)
        if trigger.state is not states[-1][1]:
            states.append((round(float(times[end - 1]), 1), trigger.state))
    return states


def test_normal_is_armed_again_and_single_stops() -> None:
    assert run(Mode.NORMAL)[:5] == [
        (0.0, TriggerState.ARMED),
        (5.0, TriggerState.TRIGGERED),
        (6.0, TriggerState.SHOWN),
        (6.1, TriggerState.ARMED),
        (10.0, TriggerState.TRIGGERED),
    ]
    assert run(Mode.SINGLE) == [
        (0.0, TriggerState.ARMED),
        (5.0, TriggerState.TRIGGERED),
        (6.0, TriggerState.STOPPED),
    ]


def test_the_hold_off_lets_events_pass() -> None:
    assert [at for at, state in run(Mode.NORMAL, hold_off_s=7.0) if state is TriggerState.TRIGGERED] == [
        5.0,
        15.0,
    ]


@pytest.mark.parametrize(("before", "shown"), [(0.0, 7.0), (0.25, 6.5), (1.0, 5.0)])
def test_the_share_before_says_how_long_it_waits_for_what_comes_after(before: float, shown: float) -> None:
    done = [at for at, state in run(Mode.SINGLE, before=before) if state is TriggerState.STOPPED]
    assert done == [pytest.approx(shown, abs=0.11)]


def test_auto_shows_what_comes_where_nothing_triggers_and_normal_keeps_the_last() -> None:
    times, values = np.arange(0.0, 10.0, 0.1), np.zeros(100)
    values[50:] = 1.0
    for mode, goes_on in ((Mode.AUTO, True), (Mode.NORMAL, False)):
        trigger = Trigger()
        trigger.arm(Condition(On.RISE, "x", 0.5, mode=mode), 0.0)
        assert trigger.shows_live(0.0)
        for end in range(40, 101):
            trigger.take(times[:end], values[:end], 2.0)
        assert trigger.count == 1
        assert trigger.state is TriggerState.ARMED
        assert trigger.shows_live(9.9) is goes_on


def test_another_axis_of_time_arms_it_anew_and_off_is_off() -> None:
    trigger = Trigger()
    trigger.arm(Condition(On.ABOVE, "x", 0.5, before=0.0), None)
    trigger.take(np.array([1.0]), np.array([1.0]), 2.0)
    assert trigger.state is TriggerState.TRIGGERED
    trigger.begin_anew()
    assert (trigger.state, trigger.at_s) == (TriggerState.ARMED, None)
    trigger.off()
    assert not trigger.take(np.array([2.0]), np.array([1.0]), 2.0)
    assert trigger.shows_live(2.0)
    assert trigger.text(2.0) == "off"


@pytest.mark.parametrize(
    ("condition", "problem"),
    [
        (Condition(), "no curve"),
        (Condition(On.ENTERS, "x", 2.0, 1.0), "upper end"),
        (Condition(On.RISE, "x", math.nan), "a number that is none"),
        (Condition(On.RISE, "x", before=1.5), "0 to 1"),
        (Condition(On.RISE, "x", hold_off_s=1e6), "hold-off"),
        (Condition(On.RISE, "x"), ""),
    ],
)
def test_what_could_never_trigger_says_so(condition: Condition, problem: str) -> None:
    assert problem in condition.problem
    assert bool(problem) is bool(condition.problem)
