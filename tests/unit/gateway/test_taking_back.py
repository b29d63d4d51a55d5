"""What is taken back, and what is left alone: one rule for roll-back, a trial's end, revert and restart."""

from pathlib import Path
from typing import Any

import pytest

from drivers.errors import DeviceAbort, DeviceTimeout
from gateway.modules.stop.machine import Input
from gateway.records.undo import UndoFile
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import DISABLED, ENABLED, Bench
from tests.unit.gateway.tuned import (
    CYCLE,
    CYCLE_TIME,
    LONG_S,
    MAX_TORQUE,
    STEP,
    STEP_LENGTH,
    TOE,
    TOE_HEIGHT,
    TORQUE,
    Gate,
    Tuned,
    drives,
    held,
    silent_but_for,
    somebody_writes,
    tuned,
    u16,
)

# One rule: what is ours


def test_what_the_device_has_made_of_a_value_is_ours_too(robot: Tuned, bench: Bench) -> None:
    """A device that clamps holds neither what was written nor what was there before."""
    bench.gait.node.store = lambda index, data: u16(410) if data == u16(420) else data
    error = robot.refused(robot.writing({STEP_LENGTH: 0.42}))
    assert (error.kind, error.data.outcome) == ("rolled_back", {STEP_LENGTH: "taken back"})
    assert held(bench, STEP) == 400
    assert robot.undos() == []


def test_what_the_device_has_made_is_known_to_the_next_gateway(calm: Bench, tmp_path: Path) -> None:
    """Its roll-back fails, and it ends."""

    def clamp(index: int, data: bytes) -> bytes:
        calm.gait.node.before_upload = silent_but_for(1)
        return u16(410)

    calm.gait.node.store = clamp
    with tuned(tmp_path) as robot:
        assert robot.refused(robot.writing({STEP_LENGTH: 0.42})).kind == "rollback_failed"
        assert [one.made for one in robot.undos()[0].changes] == [u16(410).hex()]
    calm.gait.node.store = lambda _index, data: data
    calm.gait.node.before_upload = lambda _index: None
    with tuned(tmp_path) as robot:
        until(lambda: held(calm, STEP) == 400, "taken back")
        until(lambda: robot.undos() == [], "settled")


def test_a_roll_back_leaves_alone_what_somebody_else_has_written_in_between(
    robot: Tuned, bench: Bench
) -> None:
    def interfere(index: int, _data: bytes) -> None:
        if index == CYCLE[2]:
            somebody_writes(bench, STEP, 333)
            raise DeviceAbort("no", 0x0800_0000)

    bench.gait.node.before_download = interfere
    error = robot.refused(robot.writing({STEP_LENGTH: 0.38, CYCLE_TIME: 1.1}))
    assert error.kind == "rollback_failed"
    assert error.data.outcome is not None
    assert error.data.outcome[STEP_LENGTH].startswith("left alone: it holds 4d 01")
    assert held(bench, STEP) == 333
    assert (robot.undos(), robot.trials()) == ([], [])  # it is said, and nothing more is to be done


def test_a_late_answer_is_waited_for_before_anything_is_called_unknown(robot: Tuned, bench: Bench) -> None:
    """The device answers every second read only."""
    node, number = bench.gait.node, 0

    def every_second(_index: int) -> None:
        nonlocal number
        number += 1
        if node.written() and number % 2:
            raise DeviceTimeout("no answer within 0.5 s")

    def lose_the_answer(_index: int, data: bytes) -> None:
        if data == u16(420):
            node.objects[STEP[2:]] = data
            raise DeviceTimeout("no answer")

    node.before_upload, node.before_download = every_second, lose_the_answer
    error = robot.refused(robot.writing({STEP_LENGTH: 0.42}))
    assert (error.kind, error.data.outcome) == ("rolled_back", {STEP_LENGTH: "taken back"})
    assert held(bench, STEP) == 400


def test_what_nobody_knows_is_not_called_unchanged_and_stays_to_be_taken_back(
    robot: Tuned, bench: Bench
) -> None:
    def lose_the_answer(_index: int, data: bytes) -> None:
        bench.gait.node.objects[STEP[2:]] = data
        bench.gait.node.before_upload = silent_but_for(0)
        raise DeviceTimeout("no answer")

    bench.gait.node.before_download = lose_the_answer
    error = robot.refused(robot.writing({STEP_LENGTH: 0.42}))
    assert error.kind == "rollback_failed"
    assert error.data.outcome == {STEP_LENGTH: "unknown: no answer"}
    assert [one.values() for one in robot.undos()] == [{STEP_LENGTH: 0.42}]
    bench.gait.node.before_download = lambda _index, _data: None
    bench.gait.node.before_upload = lambda _index: None
    until(lambda: held(bench, STEP) == 400, "taken back")
    until(lambda: robot.undos() == [], "settled")


def test_the_answer_to_the_way_back_may_be_lost_as_long_as_the_value_can_be_read(
    robot: Tuned, bench: Bench
) -> None:
    write = robot.write({STEP_LENGTH: 0.42}, LONG_S)

    def lose_the_answer(_index: int, data: bytes) -> None:
        bench.gait.node.objects[STEP[2:]] = data
        raise DeviceTimeout("no answer")

    bench.gait.node.before_download = lose_the_answer
    assert robot.revert(write) == {STEP_LENGTH: "taken back"}


def test_what_is_settled_is_not_taken_back_again(robot: Tuned, bench: Bench) -> None:
    """One of two devices is away; the other's value is changed by somebody else, to what was on trial."""
    write = robot.write({STEP_LENGTH: 0.42, MAX_TORQUE: 50}, LONG_S)
    bench.left.node.ready = False
    assert robot.refused(lambda: robot.tuning.trials.revert(write)).kind == "rollback_failed"
    assert held(bench, STEP) == 400
    assert [list(one.values) for one in robot.trials()] == [[MAX_TORQUE]]
    somebody_writes(bench, STEP, 420)
    bench.left.node.ready = True
    until(lambda: robot.trials() == [], "the other is taken back")
    assert (held(bench, STEP), held(bench, TORQUE)) == (420, 1000)


# Two facts: whether the node answers, and whether samples come


@pytest.mark.usefixtures("impatient")
def test_a_drive_whose_samples_are_missing_is_taken_back_all_the_same(robot: Tuned, bench: Bench) -> None:
    write = robot.write({MAX_TORQUE: 50}, LONG_S)
    bench.left.lost = "no position for 3 s"
    assert robot.revert(write) == {MAX_TORQUE: "taken back"}
    assert held(bench, TORQUE) == 1000
    read = robot.do(lambda: robot.tuning.read([MAX_TORQUE], robot.session)).values[MAX_TORQUE]
    assert (read.value, read.problem) == (100.0, None)


def test_a_node_that_has_not_come_up_is_out_of_reach_for_now(robot: Tuned, bench: Bench) -> None:
    write = robot.write({MAX_TORQUE: 50}, LONG_S)
    bench.left.node.ready = False
    error = robot.refused(lambda: robot.tuning.trials.revert(write))
    assert error.kind == "rollback_failed"
    assert error.data.outcome == {MAX_TORQUE: "unknown: it is silent"}
    bench.left.node.ready = True
    until(lambda: held(bench, TORQUE) == 1000, "taken back")
    until(lambda: robot.trials() == [], "ended")
    assert robot.told("taken back")[0]["reason"] == "asked for"  # as when it was begun


# On the way back as on the way there: the drives


def test_what_is_not_live_waits_until_the_drives_are_off_again(robot: Tuned, bench: Bench) -> None:
    write = robot.write({TOE_HEIGHT: 0.09}, LONG_S)
    bench.right.set_state(ENABLED)
    error = robot.refused(lambda: robot.tuning.trials.revert(write))
    assert error.kind == "rollback_failed"
    assert "not yet: gait.toe_height: the state of right_knee is operation enabled" in str(error)
    (trial,) = robot.trials()
    assert trial.problem is not None
    assert "right_knee is operation enabled" in trial.problem
    assert [data for _, data in bench.gait.node.written()] == [u16(90)]
    bench.right.set_state(DISABLED)
    until(lambda: held(bench, TOE) == 80, "taken back as soon as it can be")
    until(lambda: robot.trials() == [], "ended")


def test_a_roll_back_does_not_write_to_a_drive_that_was_enabled_meanwhile(robot: Tuned, bench: Bench) -> None:
    def enable(index: int, _data: bytes) -> None:
        if index == TOE[2]:
            drives(bench, ENABLED)

    bench.gait.node.before_download = enable
    error = robot.refused(robot.writing({TOE_HEIGHT: 0.07, MAX_TORQUE: 110}))
    assert error.kind == "rollback_failed"
    assert error.data.outcome is not None
    assert "left_knee is operation enabled" in str(error)
    assert error.data.outcome[MAX_TORQUE] == "not written"
    assert error.data.outcome[TOE_HEIGHT].startswith("not yet: ")
    assert (held(bench, TOE), held(bench, TORQUE)) == (70, 1000)
    drives(bench, DISABLED)
    until(lambda: held(bench, TOE) == 80, "taken back")


def test_the_drives_are_asked_again_right_before_the_first_download(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One is enabled while what is to be taken back is made durable."""
    change = UndoFile.change

    def slow(self: UndoFile, *given: Any, **named: Any) -> None:
        change(self, *given, **named)
        bench.right.set_state(ENABLED)

    monkeypatch.setattr(UndoFile, "change", slow)
    error = robot.refused(robot.writing({TOE_HEIGHT: 0.09}))
    assert (error.kind, error.data.outcome) == ("wrong_state", {TOE_HEIGHT: "not written"})
    assert bench.gait.node.written() == []


def test_an_unknown_state_of_a_drive_means_do_not_on_the_way_back_too(robot: Tuned, bench: Bench) -> None:
    write = robot.write({TOE_HEIGHT: 0.09}, LONG_S)
    statusword = bench.left.node.objects.pop((0x6041, 0))
    assert "left_knee is unknown" in str(robot.refused(lambda: robot.tuning.trials.revert(write)))
    bench.left.node.objects[0x6041, 0] = statusword
    until(lambda: held(bench, TOE) == 80, "taken back")


def test_drives_are_not_enabled_over_a_trial_that_could_not_be_taken_back_then(
    robot: Tuned, bench: Bench
) -> None:
    def objection(*joints: str) -> str | None:
        found: str | None = robot.do(lambda: robot.tuning.enabling_objection(joints))
        return found

    assert objection("left_knee", "right_knee") is None
    live = robot.write({CYCLE_TIME: 1.3}, LONG_S)
    assert objection("left_knee", "right_knee") is None
    torque = robot.write({MAX_TORQUE: 50}, LONG_S)
    said = objection("right_knee", "left_knee")
    assert said is not None
    assert said.startswith(f"{MAX_TORQUE}, which enabled drives do not allow, is on trial (write {torque} of")
    assert objection("right_knee") is None
    robot.write({TOE_HEIGHT: 0.09}, LONG_S)  # it may move every joint
    assert objection("right_knee") is not None
    robot.do(lambda: robot.tuning.trials.revert_all("enough"))
    until(lambda: robot.trials() == [], "all ended")
    assert objection("left_knee", "right_knee") is None
    assert live


def test_drives_are_not_enabled_while_what_they_do_not_allow_is_written(robot: Tuned, bench: Bench) -> None:
    gate = Gate(bench.gait.node, TOE[2])
    write = robot.ask(robot.writing({TOE_HEIGHT: 0.09}))
    gate.wait()
    said = robot.do(lambda: robot.tuning.enabling_objection(["left_knee"]))
    assert said == f"{TOE_HEIGHT}, which enabled drives do not allow, is being written"
    gate.open()
    write.result(WAIT_S)
    assert robot.do(lambda: robot.tuning.enabling_objection(["left_knee"])) is None


def test_what_enabled_drives_do_not_allow_is_not_begun_while_they_are_being_enabled(
    robot: Tuned, bench: Bench
) -> None:
    robot.authority.feed(Input.ENABLE, lambda _step: None)
    error = robot.refused(robot.writing({TOE_HEIGHT: 0.09}))
    assert (error.kind, "an enabling is under way" in str(error)) == ("wrong_state", True)
    robot.write({CYCLE_TIME: 1.3})
    assert [index for index, _ in bench.gait.node.written()] == [CYCLE[2]]


# On the way back as on the way there: limits and the largest step


def test_a_trial_whose_way_back_would_be_too_far_is_refused(robot: Tuned, bench: Bench) -> None:
    """Each step is small enough; the way back from the last would not be."""
    first = robot.write({STEP_LENGTH: 0.36}, LONG_S)
    robot.write({STEP_LENGTH: 0.31}, LONG_S)
    error = robot.refused(robot.writing({STEP_LENGTH: 0.27}, LONG_S))
    assert (error.kind, error.data.limit) == ("out_of_limit", 0.1)
    assert "it could not be taken back at the end of the trial" in str(error)
    assert "from 0.27 m it may change by 0.1 m at once, not by 0.13" in str(error)
    assert held(bench, STEP) == 310
    assert robot.told("trial begun")[0]["write"] == first


def test_a_value_beyond_its_limits_is_left_only_for_good(robot: Tuned, bench: Bench) -> None:
    """What could not be written back is not tried; written without a trial it is."""
    somebody_writes(bench, STEP, 650)
    error = robot.refused(robot.writing({STEP_LENGTH: 0.58}, LONG_S))
    assert (error.kind, error.data.limit) == ("out_of_limit", 0.6)
    assert "0.65 m is above the maximum 0.6 m" in str(error)
    robot.write({STEP_LENGTH: 0.58})
    assert held(bench, STEP) == 580


def test_a_roll_back_does_not_go_beyond_the_limits_either(robot: Tuned, bench: Bench) -> None:
    somebody_writes(bench, STEP, 650)

    def refuse(index: int, _data: bytes) -> None:
        if index == CYCLE[2]:
            raise DeviceAbort("no", 0x0800_0000)

    bench.gait.node.before_download = refuse
    error = robot.refused(robot.writing({STEP_LENGTH: 0.58, CYCLE_TIME: 1.3}))
    assert error.kind == "rollback_failed"
    assert error.data.outcome is not None
    assert error.data.outcome[STEP_LENGTH].startswith("given up: gait.step_length: 0.65 m is above")
    assert (held(bench, STEP), robot.undos()) == (580, [])
