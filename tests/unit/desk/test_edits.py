"""Edits: staged and not sent, exactly the difference, never over what somebody else changed unseen."""

import time

import pytest

from gateway.client import CallTimeout, RemoteError
from gateway.units import Units
from gateway.wire.parameter import Confirmed, Reverted, Written
from server_gui.core.desk.station import Station
from server_gui.core.tuning.edits import ReviewedEdit
from server_gui.core.tuning.writing import WriteState
from tests.support.desk import HELD, Bench, described, looked

STEP, ANGLE, TORQUE = "gait.step_length", "gait.trunk_angle", "left_knee.max_torque"


def stage(station: Station, name: str, value: float) -> None:
    station.edits.stage(name, value, station.robot.parameters.get(name))


def changes(bench: Bench) -> tuple[ReviewedEdit, ...]:
    return bench.station.difference(Units())


def on_trial(bench: Bench, seconds: float = 20.0) -> int:
    """A trial of another step length; when it is over, on our clock."""
    stage(bench.station, STEP, 0.43)
    bench.station.writing.began(changes(bench))
    bench.station.edits.drop(STEP)
    bench.station.writing.done(Written(7, {STEP: 0.4}, {STEP: 0.43}, trial_s=seconds))
    assert bench.station.writing.trial is not None
    return bench.station.writing.trial.until_ns


def test_what_is_staged_is_not_sent(bench: Bench) -> None:
    stage(bench.station, STEP, 0.43)
    assert bench.first.asked == []


def test_the_difference_is_what_is_other_than_held_in_the_robots_order(bench: Bench) -> None:
    for name, value in ((TORQUE, 60.0), (ANGLE, 0.06), (STEP, 0.43), (ANGLE, HELD[ANGLE])):
        stage(bench.station, name, value)
    assert [(change.name, change.old, change.new) for change in changes(bench)] == [
        (STEP, 0.4, 0.43),
        (TORQUE, 80.0, 60.0),
    ]


def test_what_the_robot_has_come_to_hold_is_no_difference(bench: Bench) -> None:
    stage(bench.station, STEP, 0.43)
    bench.station.take([looked({**HELD, STEP: 0.43})])
    assert changes(bench) == ()


def test_a_change_by_somebody_else_is_told(bench: Bench) -> None:
    stage(bench.station, STEP, 0.43)
    assert [change.elsewhere for change in changes(bench)] == [False]
    bench.station.take([looked({**HELD, STEP: 0.45})])
    stage(bench.station, STEP, 0.44)  # typed anew: it is still to be seen
    assert [(change.old, change.elsewhere) for change in changes(bench)] == [(0.45, True)]


@pytest.mark.parametrize(
    ("value", "why"),
    [
        (0.7, "above the largest allowed, 600 mm"),
        (0.1, "below the smallest allowed, 200 mm"),
        (0.52, "further than one write may go, 100 mm: take two steps"),
        (0.5, None),
    ],
)
def test_what_the_robot_would_refuse_is_known_before(bench: Bench, value: float, why: str | None) -> None:
    stage(bench.station, STEP, value)
    assert [change.problem for change in changes(bench)] == [why]


def test_parameters_that_are_gone_take_their_edits_along_and_that_is_said(bench: Bench) -> None:
    stage(bench.station, STEP, 0.43)
    stage(bench.station, TORQUE, 60.0)
    bench.station.take([described(parameters={TORQUE: 80.0})])
    assert list(bench.station.edits.staged) == [TORQUE]
    assert STEP in bench.desk.news.items[0].text


def test_edits_stay_with_their_robot(bench: Bench) -> None:
    stage(bench.station, STEP, 0.43)
    other = bench.add("exo-02", 7421)
    other.take([described("exo-02"), looked()])
    assert not other.edits.staged
    assert list(bench.station.edits.staged) == [STEP]


def test_a_write_asks_for_exactly_the_difference_and_ends_the_edits(bench: Bench) -> None:
    stage(bench.station, STEP, 0.43)
    bench.station.write(changes(bench))
    assert bench.first.asked == [("write", ({STEP: 0.43}, None))]
    assert list(bench.station.edits.staged) == [STEP], "it is not written yet"
    bench.first.answer(Written(1, {STEP: 0.4}, {STEP: 0.43}))
    assert not bench.station.edits.staged
    assert bench.station.writing.state is WriteState.DONE


@pytest.mark.parametrize(
    ("error", "state", "row"),
    [
        (
            RemoteError(-32012, "rolled back", {"kind": "rolled_back", "outcome": {STEP: "it holds 429"}}),
            WriteState.FAILED,
            "it holds 429",
        ),
        (RemoteError(-32011, "no answer", {"kind": "device_timeout"}), WriteState.UNKNOWN, "no answer"),
        (CallTimeout("no answer in 30 s"), WriteState.UNKNOWN, "no answer in 30 s"),
    ],
)
def test_a_refusal_and_what_nobody_knows_are_told_apart_and_the_edit_stays(
    bench: Bench, error: Exception, state: WriteState, row: str
) -> None:
    stage(bench.station, STEP, 0.43)
    bench.station.write(changes(bench))
    bench.first.fail(error)
    assert bench.station.writing.state is state
    assert bench.station.writing.rows == {STEP: row}
    assert list(bench.station.edits.staged) == [STEP]


def test_undo_stages_the_inverse_and_writes_nothing(bench: Bench) -> None:
    stage(bench.station, STEP, 0.43)
    bench.station.write(changes(bench))
    bench.first.answer(Written(1, {STEP: 0.4}, {STEP: 0.43}))
    bench.station.take([looked({**HELD, STEP: 0.43})])
    bench.station.stage_undo()
    assert [(change.old, change.new) for change in changes(bench)] == [(0.43, 0.4)]
    assert len(bench.first.asked) == 1


@pytest.mark.parametrize(
    ("read_after_s", "holds", "said"),
    [
        (1.0, 0.4, "on trial"),  # too early to tell
        (60.0, 0.4, "the robot has taken it back: step length (gait) is 400 mm again; see Edits"),
        (60.0, 0.43, "other values are held"),
    ],
)
def test_a_trial_is_over_when_the_robot_holds_the_old_values_again(
    bench: Bench, read_after_s: float, holds: float, said: str
) -> None:
    over_ns = on_trial(bench)
    read_ns = over_ns + round(read_after_s * 1e9)
    bench.station.take([looked({**HELD, STEP: holds}, at_ns=read_ns)])
    bench.station.reverted.look_if_over(over_ns + 10**11)
    assert said in bench.station.writing.text
    assert (bench.station.writing.trial is None) == (said != "on trial")


def test_a_trial_whose_end_nobody_has_looked_at_is_not_over(bench: Bench) -> None:
    over_ns = on_trial(bench)
    bench.station.reverted.look_if_over(over_ns + 10**11)
    assert bench.station.writing.trial is not None


def test_a_trial_is_kept_or_taken_back_by_its_number(bench: Bench) -> None:
    for ask, answer in (
        (bench.station.keep_trial, Confirmed(7, {STEP: 0.43})),
        (bench.station.end_trial, Reverted(7, {STEP: "taken back"})),
    ):
        on_trial(bench)
        ask()
        bench.first.answer(answer)
        assert bench.station.writing.trial is None
    assert bench.first.asked == [("confirm", (7,)), ("revert", (7,))]


@pytest.mark.parametrize(
    ("holds", "after_s", "said"),
    [
        (0.43, 0.1, "taken back: the values shown are read again …"),  # asked for before the answer
        (0.4, 0.1, "taken back: step length (gait) is 400 mm again"),
        (0.43, 5.0, "taken back, but other values are held: look at them"),
    ],
)
def test_what_was_taken_back_is_said_to_be_when_it_is_shown_so(
    bench: Bench, holds: float, after_s: float, said: str
) -> None:
    on_trial(bench)
    bench.station.end_trial()
    bench.first.answer(Reverted(7, {STEP: "taken back"}))
    assert bench.station.writing.text == "taken back: the values shown are read again …"
    read_ns = time.monotonic_ns() + round(after_s * 1e9)
    bench.station.take([looked({**HELD, STEP: holds}, at_ns=read_ns)])
    assert bench.station.writing.text == said


def test_what_was_written_and_read_back_is_shown_at_once(bench: Bench) -> None:
    stage(bench.station, STEP, 0.43)
    bench.station.write(changes(bench))
    bench.first.answer(Written(1, {STEP: 0.4}, {STEP: 0.43}))
    assert bench.station.robot.parameters[STEP].value == 0.43
