"""Whatever happens, in whatever order: the original value is back and was read to be, or that is an error."""

from collections.abc import Callable, Mapping
from typing import Any, Final

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.wire.control import JournalEntries
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import Kind
from server_gui.core.experiments.machine import ENDS, TABLE, Action, ExperimentState
from server_gui.core.experiments.machine import Event as Step
from server_gui.core.experiments.plan import Bounds
from server_gui.core.experiments.result import result
from server_gui.core.experiments.stop_rules import StopRules
from server_gui.core.follow.events import Journalled
from tests.support.desk import telemetry
from tests.unit.experiments.world import NAME, ORIGINAL, World

HAPPENINGS: Final[Mapping[str, Callable[[World], Any]]] = {
    "answer": World.carry_out,
    "a while": lambda world: world.sleep(1.0),
    "a long while": lambda world: world.sleep(36.0),
    "the link dies": World.drop,
    "the link dies between write and answer": World.drop_late,
    "the link is back": World.link,
    "the guard warns": World.alarm,
    "somebody stops": World.stop,
    "the user says stop": lambda world: world.run.halt("asked for"),
    "the robot restarts": World.restart,
    "another desk has the lease": lambda world: setattr(world, "is_taken", True),
    "nobody walks": lambda world: setattr(world, "is_walking", False),
    "no telemetry": lambda world: setattr(world, "is_told", False),
    "nobody watches": lambda world: setattr(world, "is_watched", False),
}


def check(world: World) -> None:
    """What must hold always."""
    if world.run.state is ExperimentState.OVER:
        assert world.trial is None
        assert world.value == ORIGINAL
    if world.run.state is ExperimentState.NOTHING_DONE:
        assert not world.wrote


@given(st.lists(st.sampled_from(sorted(HAPPENINGS)), max_size=14), st.booleans())
@settings(max_examples=40, deadline=None)
def test_in_any_order_the_original_is_back_or_it_is_an_error(orders: list[str], steals: bool) -> None:
    world = World()
    world.sleep(2.0)
    for place, what in enumerate(orders):
        HAPPENINGS[what](world)
        check(world)
        if steals and place == 5:
            world.steal()
            break
    world.settle()
    assert world.trial is None
    if world.value == ORIGINAL:
        assert world.run.state in (
            ExperimentState.OVER,
            ExperimentState.NOTHING_DONE,
            ExperimentState.NOT_CONFIRMED,
        )
    elif world.wrote and world.run.state is ExperimentState.OVER:
        raise AssertionError("another value is held, and nobody has said so")


@pytest.mark.parametrize(
    "state",
    [
        ExperimentState.LOOKING,
        ExperimentState.WRITING,
        ExperimentState.HOLDING,
        ExperimentState.TAKING_BACK,
        ExperimentState.READING,
    ],
)
@pytest.mark.parametrize("what", sorted(HAPPENINGS))
def test_each_happening_in_each_state_ends_well(state: ExperimentState, what: str) -> None:
    world = World()
    if state is not ExperimentState.LOOKING:
        world.until(ExperimentState.WRITING if state is ExperimentState.WRITING else ExperimentState.HOLDING)
    if state in (ExperimentState.TAKING_BACK, ExperimentState.READING):
        world.run.halt("asked for")
    if state is ExperimentState.READING:
        world.carry_out()
    assert world.run.state is state
    HAPPENINGS[what](world)
    check(world)
    world.settle()
    check(world)
    assert world.run.is_over
    assert world.run.state is not ExperimentState.NOT_CONFIRMED or what in ("a long while", "no telemetry")


def test_all_goes_well() -> None:
    world = World()
    world.settle()
    assert world.run.is_whole
    assert world.wrote == [0.4, 0.42, 0.44]
    assert [period.cycles for period, _ in world.run.periods] == [3, 3, 3]
    assert world.run.transients == 3


@pytest.mark.parametrize(
    ("what", "why"),
    [
        ("the guard warns", "too far"),
        ("somebody stops", "STOP"),
        ("nobody walks", "does not walk any more"),
        ("no telemetry", "no telemetry for 2 s"),
        ("nobody watches", "nobody watches"),
        ("the robot restarts", "started anew"),
        ("another desk has the lease", "another desk has control"),
        ("the user says stop", "asked for"),
    ],
)
def test_each_rule_ends_it_at_once_with_its_reason(what: str, why: str) -> None:
    world = World()
    world.until(ExperimentState.HOLDING)
    HAPPENINGS[what](world)
    wrote = len(world.wrote)
    world.sleep(7.0)
    world.settle()
    assert why in world.run.why
    assert len(world.wrote) <= wrote + (what in ("another desk has the lease", "nobody watches"))
    assert world.run.state is ExperimentState.OVER


@pytest.mark.parametrize(
    ("kind", "lasts_s", "ends"),
    [
        (Kind.STALE, 4.0, False),
        (Kind.BUS, 4.0, False),
        (Kind.UPLOAD, 4.0, False),
        (Kind.PART_STALE, 1.0, False),
        (Kind.PART_STALE, 3.0, True),
        (Kind.FAULT, 0.5, True),
        (Kind.LOST, 0.5, True),
        (Kind.BUS_FAILS, 0.5, True),
        (Kind.BLIND, 0.5, True),
        (Kind.REPORTS, 0.5, True),
    ],
)
def test_what_a_busy_computer_has_for_a_moment_ends_nothing(kind: Kind, lasts_s: float, ends: bool) -> None:
    world = World()
    world.until(ExperimentState.HOLDING)
    world.alarms = [Alarm(kind, "gait", "said of it")]
    world.sleep(lasts_s)
    world.alarms = []
    world.settle()
    assert world.run.is_whole is not ends
    assert ("said of it" in world.run.why) is ends


def test_what_another_master_has_written_is_never_called_back() -> None:
    world = World()
    world.until(ExperimentState.HOLDING)
    world.sleep(0.5)
    world.steal()
    world.settle()
    assert world.run.state is ExperimentState.NOT_CONFIRMED
    assert "somebody else has written it" in world.run.why
    assert f"{NAME} = 550 mm" in world.run.back


def test_a_robot_that_never_answers_again_is_not_confirmed() -> None:
    world = World()
    world.until(ExperimentState.HOLDING)
    world.drop()
    world.run.halt("asked for")
    world.sleep(120.0)
    assert world.run.state is ExperimentState.NOT_CONFIRMED


def test_a_value_that_has_changed_meanwhile_begins_nothing() -> None:
    world = World()
    world.value = 0.43
    world.settle()
    assert world.run.state is ExperimentState.NOTHING_DONE
    assert "begin anew" in world.run.why
    assert not world.wrote


def test_from_every_state_there_is_a_way_out_and_nothing_is_written_on_it() -> None:
    for state in ExperimentState:
        told = {step: after for (before, step), after in TABLE.items() if before is state}
        if state in ENDS:
            assert set(told) <= {Step.WRITTEN}
            continue
        assert Step.LATE in told
        for step in (Step.HALT, Step.LATE, Step.REFUSED, Step.UNSURE):
            if step in told:
                assert told[step][1] is not Action.WRITE


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        (
            {"n": 7, "who": "guard", "what": "alarm", "about": "tilt", "reason": "too far"},
            "the guard: alarm, too far",
        ),
        (
            {"n": 7, "who": "anna", "what": "write", "after": {"gait.cycle_time": 1.1}},
            "a write of another: anna",
        ),
        ({"n": 7, "who": "anna", "what": "write", "after": {NAME: 0.42}, "trial_s": 30.0}, ""),
        ({"n": 7, "who": "anna", "what": "trial begun", "after": {NAME: 0.42}}, ""),
        ({"n": 7, "who": "gateway", "what": "taken back"}, "taken the trial back"),
        ({"n": 7, "who": "anna", "what": "stop", "monotonic_ns": 1}, ""),  # long ago
    ],
)
def test_the_journal_ends_it_by_what_others_do_now(entry: dict[str, Any], why: str) -> None:
    world = World()
    world.until(ExperimentState.HOLDING)
    world.run.take(Journalled(JournalEntries([entry])))
    assert why in (world.run.watch.why or "")
    assert bool(world.run.watch.why) is bool(why)


def test_it_was_run_by_whom_the_robots_journal_names() -> None:
    """A robot without keys tells nobody who they are, yet its journal names the author of each write."""
    world = World()
    world.until(ExperimentState.HOLDING)
    written = {"what": "write", "after": {NAME: 0.8}, "trial_s": 60.0, "monotonic_ns": world.now_ns + 1}
    world.run.take(Journalled(JournalEntries([{"n": 7, "who": "gwrms ab (127.0.0.1:40112)", **written}])))
    world.settle()
    told = result(world.run, "this desk", "A")
    assert told is not None
    assert told.edit.who == "gwrms ab (127.0.0.1:40112)"


def test_a_journal_that_was_begun_anew_tells_of_a_stop_all_the_same() -> None:
    watch = StopRules(NAME, ("left_knee",), Bounds())
    watch.take(Journalled(JournalEntries([{"n": 500, "who": "anna", "what": "note", "monotonic_ns": 1}])))
    watch.begin((), 2)
    watch.take(Journalled(JournalEntries([{"n": 1, "who": "anna", "what": "stop", "monotonic_ns": 3}])))
    assert watch.why == "somebody has sent a STOP (anna)"


@pytest.mark.parametrize(("bounds", "is_usual"), [(Bounds(), True), (Bounds(error=0.015), False)])
def test_a_bound_that_nobody_chose_says_what_to_do(bounds: Bounds, is_usual: bool) -> None:
    """The larger the effect of a value, the sooner twice the usual ends its trial."""
    watch = StopRules(NAME, ("left_knee",), bounds)
    watch.take(telemetry([1], {"left_knee.following_error": [-0.01]}))
    watch.begin((), 2)
    watch.take(telemetry([3], {"left_knee.following_error": [0.03]}))
    assert watch.why is not None
    limit = "0.02 rad (1.1°)" if is_usual else "0.015 rad (0.86°)"
    assert watch.why.startswith(f"left_knee: tracking error 0.03 rad (1.7°), beyond the bound of {limit}")
    assert ("--most-error" in watch.why) is is_usual
