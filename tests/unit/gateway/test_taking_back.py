"""What is taken back, and what is left alone: one rule for roll-back, a trial's end, revert and restart."""

import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from drivers.component import Kind
from drivers.errors import DeviceAbort, DeviceTimeout
from gateway.modules.stop.authority import Address
from gateway.modules.stop.machine import Input
from gateway.records import durable
from gateway.records.journal import Journal
from gateway.records.undo import UndoFile
from tests.unit.gateway.harness import (
    DEADLINE_S,
    DISABLED,
    ENABLED,
    Bench,
    Client,
    FakeNode,
    config,
    serving,
    until,
)
from tests.unit.gateway.tuned import CYCLE, STEP, TOE, TORQUE, Tuned, held, tuned

STEP_LENGTH, CYCLE_TIME, TOE_HEIGHT = "gait.step_length", "gait.cycle_time", "gait.toe_height"
MAX_TORQUE = "left_knee.max_torque"
LONG_S = 100.0  # a trial that does not end by itself in a test

Serve = Callable[..., Tuned]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    """Its drives are off; what could not be taken back is tried again at once."""
    bench = Bench()
    monkeypatch.setattr("gateway.modules.component.assemble", bench.assemble)
    monkeypatch.setattr("gateway.modules.trials.FIRST_RETRY_S", 0.01)
    monkeypatch.setattr("gateway.modules.trials.LAST_RETRY_S", 0.05)
    drives(bench, DISABLED)
    return bench


@pytest.fixture
def robot(bench: Bench, tmp_path: Path) -> Iterator[Tuned]:
    with tuned(tmp_path) as running:
        yield running


@pytest.fixture
def controlled(bench: Bench, tmp_path: Path) -> Iterator[Tuned]:
    """A robot whose controller is stopped by its step length."""
    with tuned(tmp_path, STEP) as running:
        yield running


def drives(bench: Bench, statusword: int) -> None:
    for drive in (bench.left, bench.right):
        drive.set_state(statusword)


def u16(value: int) -> bytes:
    return value.to_bytes(2, "little")


def somebody_writes(bench: Bench, address: Address, value: int) -> None:
    bench.gait.node.objects[address[2:]] = u16(value)


class Gate:
    """Holds up the first download of an object in the writer's thread."""

    def __init__(self, node: FakeNode, index: int) -> None:
        self.reached, self._open = threading.Event(), threading.Event()
        self._index = index
        node.before_download = self._wait

    def _wait(self, index: int, _data: bytes) -> None:
        if index == self._index and not self.reached.is_set():
            self.reached.set()
            assert self._open.wait(DEADLINE_S)

    def wait(self) -> None:
        assert self.reached.wait(DEADLINE_S)

    def open(self) -> None:
        self._open.set()


# One rule: what is ours


def test_what_the_device_has_made_of_a_value_is_ours_too(robot: Tuned, bench: Bench) -> None:
    """A device that clamps holds neither what was written nor what was there before."""
    bench.gait.node.store = lambda index, data: u16(410) if data == u16(420) else data
    error = robot.refused(robot.writing({STEP_LENGTH: 0.42}))
    assert (error.kind, error.data.outcome) == ("rolled_back", {STEP_LENGTH: "taken back"})
    assert held(bench, STEP) == 400
    assert robot.undos() == []


def test_what_the_device_has_made_is_known_to_the_next_gateway(bench: Bench, tmp_path: Path) -> None:
    """Its roll-back fails, and it ends."""

    def clamp(index: int, data: bytes) -> bytes:
        bench.gait.node.before_upload = silent_but_for(1)
        return u16(410)

    bench.gait.node.store = clamp
    with tuned(tmp_path) as robot:
        assert robot.refused(robot.writing({STEP_LENGTH: 0.42})).kind == "rollback_failed"
        assert [one.made for one in robot.undos()[0].changes] == [u16(410).hex()]
    bench.gait.node.store = lambda _index, data: data
    bench.gait.node.before_upload = lambda _index: None
    with tuned(tmp_path) as robot:
        until(lambda: held(bench, STEP) == 400, "taken back")
        until(lambda: robot.undos() == [], "settled")


def silent_but_for(reads: int) -> Callable[[int], None]:
    """A device that answers so many reads more."""
    left = [None] * reads

    def before_upload(_index: int) -> None:
        if not left:
            raise DeviceTimeout("no answer")
        left.pop()

    return before_upload


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


def test_a_drive_whose_samples_are_missing_is_taken_back_all_the_same(robot: Tuned, bench: Bench) -> None:
    write = robot.write({MAX_TORQUE: 50}, LONG_S)
    bench.left.lost = "no position for 3 s"
    assert robot.revert(write) == {MAX_TORQUE: "taken back"}
    assert held(bench, TORQUE) == 1000
    read = robot.do(lambda: robot.tuning.read([MAX_TORQUE])).values[MAX_TORQUE]
    assert (read.value, read.problem) == (100.0, None)


def test_a_node_that_has_not_come_up_is_out_of_reach_for_now(robot: Tuned, bench: Bench) -> None:
    write = robot.write({MAX_TORQUE: 50}, LONG_S)
    bench.left.node.ready = False
    error = robot.refused(lambda: robot.tuning.trials.revert(write))
    assert error.kind == "rollback_failed"
    assert error.data.outcome == {MAX_TORQUE: "unknown: it is silent"}
    bench.left.node.ready = True
    until(lambda: held(bench, TORQUE) == 1000, "taken back")


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
    write.result(DEADLINE_S)
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


# The stop


def test_what_was_asked_for_before_a_stop_is_not_written_after_it(robot: Tuned, bench: Bench) -> None:
    gate = Gate(bench.gait.node, CYCLE[2])
    first = robot.ask(robot.writing({CYCLE_TIME: 1.1, STEP_LENGTH: 0.42}))
    gate.wait()
    second = robot.ask(robot.writing({TOE_HEIGHT: 0.09}))
    robot.do(lambda: None)
    robot.stop()
    gate.open()
    errors = [one.exception(DEADLINE_S) for one in (first, second)]
    assert [getattr(one, "kind", None) for one in errors] == ["rolled_back", "stopped"]
    assert [data for _, data in bench.gait.node.written()] == [u16(1100), u16(1200)]


def test_a_stop_at_the_last_moment_keeps_the_download_from_the_bus(robot: Tuned, bench: Bench) -> None:
    """It comes after everything was checked, when the node's turn has come."""
    download = bench.gait.node.download

    def stopped(index: int, subindex: int, data: bytes, *given: Any, **named: Any) -> Any:
        robot.stop()
        return download(index, subindex, data, *given, **named)

    bench.gait.node.download = stopped  # type: ignore[method-assign]
    error = robot.refused(robot.writing({CYCLE_TIME: 1.1}))
    assert (error.kind, error.data.outcome) == ("stopped", {CYCLE_TIME: "not written"})
    assert bench.gait.node.written() == []


def test_what_the_guard_has_frozen_is_not_written_and_yet_taken_back(robot: Tuned, bench: Bench) -> None:
    write = robot.write({CYCLE_TIME: 1.3}, LONG_S)
    robot.authority.frozen = lambda: "the guard's rule has tripped"
    error = robot.refused(robot.writing({STEP_LENGTH: 0.42}))
    assert (error.kind, "the guard's rule has tripped" in str(error)) == ("not_allowed", True)
    assert robot.revert(write) == {CYCLE_TIME: "taken back"}


def test_a_node_that_is_not_trusted_is_not_written_to(robot: Tuned, bench: Bench) -> None:
    write = robot.write({CYCLE_TIME: 1.3}, LONG_S)
    bench.gait.node.distrust = "two devices answer as node 16"
    error = robot.refused(robot.writing({STEP_LENGTH: 0.42}))
    assert (error.kind, "two devices answer as node 16" in str(error)) == ("not_allowed", True)
    error = robot.refused(lambda: robot.tuning.trials.revert(write))
    assert error.data.outcome == {CYCLE_TIME: "not yet: two devices answer as node 16"}
    assert [data for _, data in bench.gait.node.written()] == [u16(1300)]
    bench.gait.node.distrust = None
    until(lambda: held(bench, CYCLE) == 1200, "taken back")


def test_what_stops_a_controller_is_not_written_while_a_stop_is_held(controlled: Tuned, bench: Bench) -> None:
    controlled.stop()
    error = controlled.refused(controlled.writing({STEP_LENGTH: 0.42}))
    assert (error.kind, "it stops a controller, and a stop is held" in str(error)) == ("stopped", True)
    assert bench.gait.node.log == []
    controlled.write({CYCLE_TIME: 1.3})
    controlled.reset()
    controlled.write({STEP_LENGTH: 0.42})


def test_what_a_stop_has_set_is_never_taken_back(controlled: Tuned, bench: Bench) -> None:
    write = controlled.write({STEP_LENGTH: 0.42}, LONG_S)
    controlled.stop()
    controlled.claim()
    assert (controlled.undos(), controlled.trials()) == ([], [])
    for ended in (controlled.tuning.trials.revert, controlled.tuning.trials.confirm):
        assert "it was claimed by a stop" in str(controlled.refused(lambda ended=ended: ended(write)))  # type: ignore[misc]
    controlled.reset()
    assert held(bench, STEP) == 420  # as the stop has set it, which happens to be the same here
    (told,) = controlled.told("claimed by the stop")
    assert (told["write"], told["outcome"]) == (write, {STEP_LENGTH: "left as the stop set it"})


def test_a_trial_that_ends_between_the_stop_and_its_claim_leaves_what_is_set(
    controlled: Tuned, bench: Bench
) -> None:
    write = controlled.write({STEP_LENGTH: 0.42, CYCLE_TIME: 1.3}, LONG_S)
    controlled.stop()
    assert controlled.revert(write) == {STEP_LENGTH: "left as the stop set it", CYCLE_TIME: "taken back"}
    assert (held(bench, STEP), held(bench, CYCLE), controlled.undos()) == (420, 1200, [])


def test_a_stop_claims_no_more_of_a_trial_than_it_sets(controlled: Tuned, bench: Bench) -> None:
    write = controlled.write({STEP_LENGTH: 0.42, CYCLE_TIME: 1.3}, LONG_S)
    controlled.stop()
    controlled.claim()
    (trial,) = controlled.trials()
    assert (trial.values, trial.left_s is None) == ({CYCLE_TIME: 1.3}, False)
    controlled.reset()
    assert controlled.revert(write) == {CYCLE_TIME: "taken back"}
    assert held(bench, STEP) == 420


def test_a_stop_that_comes_as_the_way_back_is_sent_wins(controlled: Tuned, bench: Bench) -> None:
    write = controlled.write({STEP_LENGTH: 0.42}, LONG_S)
    download = bench.gait.node.download

    def stopped(index: int, subindex: int, data: bytes, *given: Any, **named: Any) -> Any:
        controlled.stop()
        return download(index, subindex, data, *given, **named)

    bench.gait.node.download = stopped  # type: ignore[method-assign]
    assert controlled.revert(write) == {STEP_LENGTH: "left as the stop set it"}
    assert held(bench, STEP) == 420


def test_a_write_that_a_stop_ends_leaves_what_the_stop_sets(controlled: Tuned, bench: Bench) -> None:
    gate = Gate(bench.gait.node, CYCLE[2])
    write = controlled.ask(controlled.writing({STEP_LENGTH: 0.38, CYCLE_TIME: 1.1}))
    gate.wait()
    controlled.stop()
    gate.open()
    error: Any = write.exception(DEADLINE_S)
    assert error.kind == "rolled_back"
    assert error.data.outcome == {STEP_LENGTH: "left as the stop set it", CYCLE_TIME: "taken back"}
    assert [data for index, data in bench.gait.node.written() if index == STEP[2]] == [u16(380)]
    assert controlled.undos() == []


def test_a_claim_counts_also_when_its_stop_was_reset_before_the_roll_back_got_there(
    controlled: Tuned, bench: Bench
) -> None:
    """Its turn comes in the middle of the roll-back, between two parameters."""
    node, downloads = bench.gait.node, 0

    def before(_index: int, data: bytes) -> None:
        nonlocal downloads
        downloads += 1
        if downloads == 3:
            raise DeviceAbort("no", 0x0800_0000)
        if data == u16(1200):  # it is being rolled back
            controlled.stop()
            controlled.tuning.claim().add_done_callback(lambda _claimed: controlled.reset())

    node.before_download = before
    error = controlled.refused(controlled.writing({STEP_LENGTH: 0.38, CYCLE_TIME: 1.1, TOE_HEIGHT: 0.09}))
    assert error.data.outcome == {
        STEP_LENGTH: "left as the stop set it",
        CYCLE_TIME: "taken back",
        TOE_HEIGHT: "unchanged",
    }
    assert [index for index, _ in node.written()].count(STEP[2]) == 1
    assert not controlled.authority.held


def test_what_a_roll_back_has_left_is_claimed_too(controlled: Tuned, bench: Bench) -> None:
    def lose(_index: int, data: bytes) -> None:
        bench.gait.node.objects[STEP[2:]] = data
        bench.gait.node.before_upload = silent_but_for(0)
        raise DeviceTimeout("no answer")

    bench.gait.node.before_download = lose
    assert controlled.refused(controlled.writing({STEP_LENGTH: 0.42})).kind == "rollback_failed"
    controlled.stop()
    controlled.claim()
    bench.gait.node.before_upload = lambda _index: None
    bench.gait.node.before_download = lambda _index, _data: None
    controlled.reset()
    until(lambda: controlled.trials() == [], "claimed")
    assert (held(bench, STEP), controlled.undos()) == (420, [])


def found_held(robot: Tuned) -> None:
    """A stop that the last gateway held: it is told, and claims, before anything is taken back."""
    robot.stop()
    robot.tuning.claim()


def test_a_gateway_that_finds_a_held_stop_does_not_take_back_what_that_has_set(
    bench: Bench, tmp_path: Path
) -> None:
    write_undo(tmp_path, entry(7, change(STEP, STEP_LENGTH, 400, 420), change(CYCLE, CYCLE_TIME, 1200, 1300)))
    somebody_writes(bench, STEP, 420)
    somebody_writes(bench, CYCLE, 1300)
    with tuned(tmp_path, STEP, before=found_held) as robot:
        until(lambda: held(bench, CYCLE) == 1200, "the rest is taken back")
        until(lambda: robot.undos() == [], "settled")
        robot.reset()
        assert held(bench, STEP) == 420


# What comes at once


def test_a_trial_that_was_taken_over_by_what_failed_goes_back_to_its_first_value(
    robot: Tuned, bench: Bench
) -> None:
    """The take-over cannot be rolled back yet; the old trial's time is over meanwhile."""
    first = robot.write({STEP_LENGTH: 0.42}, LONG_S)

    def lose(_index: int, data: bytes) -> None:
        bench.gait.node.objects[STEP[2:]] = data
        bench.gait.node.distrust = "two devices answer as node 16"
        raise DeviceTimeout("no answer")

    bench.gait.node.before_download = lose
    assert robot.refused(robot.writing({STEP_LENGTH: 0.45}, LONG_S)).kind == "rollback_failed"
    error = robot.refused(lambda: robot.tuning.trials.revert(first))
    assert error.data.outcome == {
        STEP_LENGTH: "not yet: a later write of it is to be taken back first",
    }
    bench.gait.node.before_download = lambda _index, _data: None
    bench.gait.node.distrust = None
    until(lambda: robot.trials() == [], "both are taken back")
    assert held(bench, STEP) == 400


def test_what_is_taken_over_is_taken_back_in_the_order_of_its_last_writes(robot: Tuned, bench: Bench) -> None:
    robot.write({CYCLE_TIME: 1.3, STEP_LENGTH: 0.42}, LONG_S)
    second = robot.write({STEP_LENGTH: 0.38}, LONG_S)
    bench.gait.node.log.clear()
    robot.revert(second)
    assert bench.gait.node.written() == [(STEP[2], u16(400)), (CYCLE[2], u16(1200))]


def test_a_trial_that_was_being_written_when_all_were_taken_back_is_too(robot: Tuned, bench: Bench) -> None:
    """Else a rule of the guard would have no effect on what it came a moment too early for."""
    gate = Gate(bench.gait.node, CYCLE[2])
    write = robot.ask(robot.writing({CYCLE_TIME: 1.3}, LONG_S))
    gate.wait()
    robot.do(lambda: robot.tuning.trials.revert_all("guard rule tilt: too far"))
    gate.open()
    write.result(DEADLINE_S)
    until(lambda: held(bench, CYCLE) == 1200, "taken back")
    until(lambda: robot.told("taken back") != [], "told")
    assert robot.told("taken back")[0]["reason"] == "guard rule tilt: too far"


def test_a_trial_ends_in_time_also_in_the_middle_of_a_long_write(robot: Tuned, bench: Bench) -> None:
    trial = robot.write({MAX_TORQUE: 50}, LONG_S)
    gate = Gate(bench.gait.node, CYCLE[2])
    write = robot.ask(robot.writing({CYCLE_TIME: 1.1, STEP_LENGTH: 0.42}))
    gate.wait()
    ended = robot.ask(lambda: robot.tuning.trials.revert(trial))
    robot.do(lambda: None)
    gate.open()
    ended.result(DEADLINE_S)
    write.result(DEADLINE_S)
    order = [one["what"] for one in robot.told("taken back", "write done")]
    assert order == ["taken back", "write done"]
    assert (held(bench, TORQUE), held(bench, STEP)) == (1000, 420)


def test_a_trial_whose_time_ends_while_it_is_taken_over_is_that_of_the_new_one(
    robot: Tuned, bench: Bench
) -> None:
    first = robot.write({STEP_LENGTH: 0.42, CYCLE_TIME: 1.3}, LONG_S)
    gate = Gate(bench.gait.node, STEP[2])
    second = robot.ask(robot.writing({STEP_LENGTH: 0.38, MAX_TORQUE: 110}, LONG_S))
    gate.wait()
    revert = robot.ask(lambda: robot.tuning.trials.revert(first))
    robot.do(lambda: None)
    gate.open()
    revert.exception(DEADLINE_S)
    number = second.result(DEADLINE_S).write
    until(lambda: [one.write for one in robot.trials()] == [number], "one trial is left")
    robot.revert(number)
    assert (held(bench, STEP), held(bench, CYCLE), held(bench, TORQUE)) == (400, 1200, 1000)
    assert robot.undos() == []


def test_what_ended_while_a_write_was_reading_is_read_anew(robot: Tuned, bench: Bench) -> None:
    """Else it would be rolled back, or reverted, to the value of a trial that has ended."""
    first = robot.write({STEP_LENGTH: 0.42}, LONG_S)
    reverted: list[Any] = []

    def end_the_trial(index: int) -> None:
        if index == STEP[2] and not reverted:
            reverted.append(robot.ask(lambda: robot.tuning.trials.revert(first)))
            robot.do(lambda: None)

    bench.gait.node.before_upload = end_the_trial
    second = robot.do(robot.writing({STEP_LENGTH: 0.45, CYCLE_TIME: 1.3}, LONG_S))
    assert reverted[0].result(DEADLINE_S).outcome == {STEP_LENGTH: "taken back"}
    assert second.before == {STEP_LENGTH: 0.4, CYCLE_TIME: 1.2}


def test_nothing_is_confirmed_whose_time_is_over(robot: Tuned, bench: Bench) -> None:
    write = robot.write({MAX_TORQUE: 50}, LONG_S)
    bench.left.node.ready = False
    assert robot.refused(lambda: robot.tuning.trials.revert(write)).kind == "rollback_failed"
    error = robot.refused(lambda: robot.tuning.trials.confirm(write))
    assert (error.kind, "it is being taken back: asked for" in str(error)) == ("unknown_name", True)


def test_a_confirmation_that_was_asked_for_first_wins(robot: Tuned, bench: Bench) -> None:
    write = robot.write({CYCLE_TIME: 1.3}, LONG_S)

    def both() -> list[Any]:
        return [robot.tuning.trials.confirm(write), robot.tuning.trials.revert(write)]

    confirmed, reverted = robot.do(both)
    assert confirmed.result(DEADLINE_S).values == {CYCLE_TIME: 1.3}
    assert "it was confirmed" in str(reverted.exception(DEADLINE_S))
    assert held(bench, CYCLE) == 1300


def test_a_gateway_that_ends_takes_back_what_is_being_written_and_answers_who_waits(
    bench: Bench, tmp_path: Path
) -> None:
    with tuned(tmp_path) as robot:
        trial = robot.write({MAX_TORQUE: 50}, LONG_S)
        bench.left.node.ready = False
        gate = Gate(bench.gait.node, CYCLE[2])
        write = robot.ask(robot.writing({CYCLE_TIME: 1.1, STEP_LENGTH: 0.42}))
        gate.wait()
        waiting = robot.ask(robot.writing({TOE_HEIGHT: 0.09}))
        revert = robot.ask(lambda: robot.tuning.trials.revert(trial))
        robot.do(lambda: None)
        ending = threading.Thread(target=robot.tuning.close)
        ending.start()
        until(lambda: robot.tuning._ending, "it is ending")
        gate.open()
        ending.join(DEADLINE_S)
        kinds = [getattr(one.exception(DEADLINE_S), "kind", None) for one in (write, waiting, revert)]
        assert kinds[:2] == ["rolled_back", "unavailable"]
        assert kinds[2] in ("unavailable", "rollback_failed")
        assert [list(one.values()) for one in robot.undos()] == [[MAX_TORQUE]]
    assert bench.gait.node.written() == [(CYCLE[2], u16(1100)), (CYCLE[2], u16(1200))]
    bench.left.node.ready = True
    with tuned(tmp_path):
        until(lambda: held(bench, TORQUE) == 1000, "taken back by the next")


def test_a_failure_of_our_own_in_the_middle_is_taken_back_too(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_index: int, data: bytes) -> None:
        if data == u16(420):
            raise ZeroDivisionError

    bench.gait.node.before_download = fail
    error = robot.refused(robot.writing({CYCLE_TIME: 1.1, STEP_LENGTH: 0.42}))
    assert (error.kind, "ZeroDivisionError" in str(error)) == ("rolled_back", True)
    assert held(bench, CYCLE) == 1200


def test_what_was_read_of_a_trial_is_known_no_longer_when_it_has_ended(robot: Tuned, bench: Bench) -> None:
    write = robot.write({CYCLE_TIME: 1.3}, LONG_S)
    assert robot.do(lambda: robot.tuning.listed([CYCLE_TIME])).values[CYCLE_TIME].value == 1.3
    robot.revert(write)
    assert robot.do(lambda: robot.tuning.listed([CYCLE_TIME])).values[CYCLE_TIME].value is None


# What takes long


def test_dead_nodes_delay_the_others_no_longer_than_one_of_them(robot: Tuned, bench: Bench) -> None:
    """Both are asked at once, and not asked again in the same attempt."""
    write = robot.write({STEP_LENGTH: 0.42, CYCLE_TIME: 1.1, MAX_TORQUE: 50}, LONG_S)
    bench.gait.node.before_upload = silent_but_for(0)
    bench.left.node.before_upload = silent_but_for(0)
    bench.gait.node.log.clear()
    bench.left.node.log.clear()
    assert robot.refused(lambda: robot.tuning.trials.revert(write)).kind == "rollback_failed"
    bench.gait.node.before_upload = bench.left.node.before_upload = lambda _index: None
    until(lambda: held(bench, STEP) == 400, "taken back")
    first_attempt = [what for what, _index, _data in bench.gait.node.log[:2]]
    assert first_attempt == ["upload", "upload"]  # the second with more patience, and then no more


def test_what_is_not_waited_for_any_more_is_not_sent_later(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The device is busy with something urgent for longer than the writer waits."""
    monkeypatch.setattr("gateway.modules.objects.ANSWER_S", 0.05)
    asked: list[Callable[[], str | None]] = []

    def hang(*_given: Any, permitted: Callable[[], str | None], **_named: Any) -> Any:
        asked.append(permitted)
        return Future()

    bench.gait.node.download = hang  # type: ignore[assignment,method-assign]
    error = robot.refused(robot.writing({CYCLE_TIME: 1.1}))
    assert (error.kind, error.data.outcome) == ("device_timeout", {CYCLE_TIME: "unchanged"})
    assert asked[0]() == "nobody waits for it any more"


# What a gateway finds


def change(address: Address, name: str, old: int, new: int, **more: Any) -> dict[str, Any]:
    bus, node_id, index, subindex = address
    return {
        "parameter": name,
        "component": name.partition(".")[0],
        "bus": bus,
        "node_id": node_id,
        "index": index,
        "subindex": subindex,
        "before": u16(old).hex(),
        "written": u16(new).hex(),
        "before_value": old / 1000,
        "written_value": new / 1000,
    } | more


def entry(write: int, *changes: dict[str, Any], trial: bool = True) -> dict[str, Any]:
    return {"write": write, "who": "gwrms set", "utc_ns": 1, "trial": trial, "changes": changes}


def write_undo(folder: Path, *entries: dict[str, Any]) -> Path:
    path = folder / "state/gwrms/exo-test/undo.json"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(entries))
    return path


@pytest.mark.parametrize(
    ("forged", "says"),
    [
        (change(STEP, "gait.stride", 400, 420), "no longer says that 0x2001:0 of gait is gait.stride"),
        (change(STEP, "gait.0x2001:0", 400, 420), "no longer says that 0x2001:0 of gait is gait.0x2001:0"),
        (change(STEP, CYCLE_TIME, 400, 420), "no longer says that 0x2001:0 of gait is gait.cycle_time"),
        (change(STEP, STEP_LENGTH, 400, 420, component="left_knee"), "node 16 on bus 'main' is left_knee"),
        (change(STEP, STEP_LENGTH, 400, 420, bus="other"), "node 16 on bus 'other' is gait"),
        (change(STEP, STEP_LENGTH, 400, 420, component="tail"), "node 16 on bus 'main' is tail"),
        (change(STEP, STEP_LENGTH, 650, 420), "0.65 m is above the maximum 0.6 m"),
        (change(STEP, STEP_LENGTH, 560, 420), "it may change by 0.1 m at once, not by 0.14"),
        (change(STEP, STEP_LENGTH, 400, 420, before="90010000"), "90 01 00 00 is no UNSIGNED16"),
        (change(STEP, STEP_LENGTH, 400, 420, before=""), " is no UNSIGNED16"),
    ],
)
def test_what_the_robots_file_does_not_say_is_not_written(
    bench: Bench, tmp_path: Path, forged: dict[str, Any], says: str
) -> None:
    """An entry of a table that has changed, or that somebody has made up."""
    path = write_undo(tmp_path, entry(7, forged))
    somebody_writes(bench, STEP, 420)
    with tuned(tmp_path) as robot:
        until(lambda: not path.exists(), "given up")
        (told,) = robot.told("taken back")
    (what,) = told["outcome"].values()
    assert (what.startswith("given up: "), says in what) == (True, True), what
    assert bench.gait.node.written() == bench.left.node.written() == []


def test_what_an_absent_device_holds_is_not_given_up(bench: Bench, tmp_path: Path) -> None:
    path = write_undo(tmp_path, entry(7, change(STEP, STEP_LENGTH, 400, 420)))
    bench.absent["gait"] = (Kind.DEVICE, "gait.eds is broken")
    with tuned(tmp_path) as robot:
        until(lambda: robot.trials()[0].problem == f"{STEP_LENGTH}: unknown: gait.eds is broken", "said")
    assert path.exists()


def test_the_newest_is_taken_back_first_also_when_it_has_to_wait(bench: Bench, tmp_path: Path) -> None:
    """A gateway was killed in the middle of a take-over."""
    write_undo(
        tmp_path,
        entry(9, change(STEP, STEP_LENGTH, 400, 420)),
        entry(8, change(STEP, STEP_LENGTH, 420, 450)),  # its clock was set back
    )
    somebody_writes(bench, STEP, 450)
    bench.gait.node.distrust = "two devices answer as node 16"
    with tuned(tmp_path) as robot:
        until(lambda: all(one.problem for one in robot.trials()), "both have been tried")
        bench.gait.node.distrust = None
        until(lambda: robot.trials() == [], "taken back")
        assert robot.write({STEP_LENGTH: 0.42}) > 9
    assert [data for _, data in bench.gait.node.written()] == [u16(420), u16(400), u16(420)]


def test_a_write_never_has_the_number_of_what_is_to_be_taken_back(bench: Bench, tmp_path: Path) -> None:
    future = 2**60
    write_undo(tmp_path, entry(future, change(TORQUE, MAX_TORQUE, 1000, 500)))
    bench.left.node.ready = False
    with tuned(tmp_path) as robot:
        assert robot.write({CYCLE_TIME: 1.3}) == future + 1


# On disk and in the journal


@pytest.mark.parametrize(
    ("trial_s", "ending", "order"),
    [
        (None, "", ["+7", "write", "write done", "-7"]),
        (LONG_S, "confirm", ["+7", "write", "trial begun", "+7", "trial confirmed", "-7"]),
        (LONG_S, "revert", ["+7", "write", "trial begun", "+7", "taken back", "-7"]),
    ],
)
def test_whatever_is_begun_has_its_end_in_the_journal_wherever_the_gateway_is_killed(
    robot: Tuned, monkeypatch: pytest.MonkeyPatch, trial_s: float | None, ending: str, order: list[str]
) -> None:
    """The entry is there before its beginning is told, and goes when its end was told."""
    happened: list[str] = []
    append, replace = Journal.append, durable.write
    remove = durable.remove

    def tell(self: Journal, who: str, what: str, **details: Any) -> Any:
        appended = append(self, who, what, **details)
        appended.add_done_callback(lambda _done: happened.append(what))
        return appended

    def write(path: Path, data: bytes) -> None:
        replace(path, data)
        if path.name == "undo.json":
            happened.append("+7")

    def gone(path: Path) -> None:
        remove(path)
        happened.append("-7")

    monkeypatch.setattr(Journal, "append", tell)
    monkeypatch.setattr("gateway.records.durable.write", write)
    monkeypatch.setattr("gateway.records.durable.remove", gone)
    number = robot.write({CYCLE_TIME: 1.3}, trial_s)
    if ending:
        robot.do(lambda: getattr(robot.tuning.trials, ending)(number))
    assert happened == order


def test_a_write_that_was_done_and_not_answered_is_taken_back_and_that_is_told(
    bench: Bench, tmp_path: Path
) -> None:
    """The gateway was killed after the journal had it, and before its entry was dropped."""
    path = write_undo(tmp_path, entry(7, change(STEP, STEP_LENGTH, 400, 420), trial=False))
    somebody_writes(bench, STEP, 420)
    with tuned(tmp_path) as robot:
        until(lambda: not path.exists(), "taken back")
        (told,) = robot.told("taken back")
    assert (told["write"], told["outcome"]) == (7, {STEP_LENGTH: "taken back"})
    assert told["reason"] == "the gateway ended before it had answered it, or taken it back"


def test_a_write_that_cannot_be_journaled_leaves_nothing_to_be_taken_back(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.journal.os.fsync", _no_space)
        failing.setattr("gateway.records.undo.durable.write", lambda _path, _data: None)
        error = robot.refused(robot.writing({CYCLE_TIME: 1.3}))
    assert (error.kind, "nothing was written" in str(error)) == ("unavailable", True)
    assert bench.gait.node.written() == []
    robot.write({CYCLE_TIME: 1.3})
    assert robot.undos() == []


def test_a_write_whose_end_cannot_be_kept_is_taken_back(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.undo.durable.remove", _no_space)
        error = robot.refused(robot.writing({CYCLE_TIME: 1.3}))
    assert (error.kind, "this write is taken back" in str(error)) == ("rolled_back", True)
    assert held(bench, CYCLE) == 1200
    assert [one["what"] for one in robot.told("write", "write done", "write taken back")] == [
        "write",
        "write done",
        "write taken back",
    ]
    robot.write({CYCLE_TIME: 1.3})  # nothing stands in its way
    assert robot.undos() == []


def test_a_confirmation_that_cannot_be_kept_is_none_and_the_journal_says_so(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = robot.write({CYCLE_TIME: 1.3}, LONG_S)
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.undo.durable.remove", _no_space)
        error = robot.refused(lambda: robot.tuning.trials.confirm(write))
    assert (error.kind, "it stays on trial" in str(error)) == ("unavailable", True)
    assert [one["write"] for one in robot.told("trial NOT confirmed")] == [write]
    robot.do(lambda: robot.tuning.trials.confirm(write))
    assert (held(bench, CYCLE), robot.undos()) == (1300, [])


def test_what_was_taken_back_is_so_also_where_that_cannot_be_kept(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = robot.write({CYCLE_TIME: 1.3}, LONG_S)
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.undo.durable.remove", _no_space)
        assert robot.revert(write) == {CYCLE_TIME: "taken back"}
    robot.write({CYCLE_TIME: 1.3})
    assert (held(bench, CYCLE), robot.undos()) == (1300, [])


def _no_space(*_given: object) -> None:
    raise OSError(28, "No space left on device")


def test_an_undo_file_that_is_neither_read_nor_put_aside_keeps_writes_from_the_devices(
    bench: Bench, tmp_path: Path
) -> None:
    """And nothing else: control starts, and with it the stop."""
    path = write_undo(tmp_path)
    path.unlink()
    path.mkdir()  # neither can be read, nor be replaced by a file
    (path / "full").touch()
    with no_renaming_of_undo(), serving(config(tmp_path)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        for trial in ({}, {"trial_s": 60}):
            error = client.refused("parameter.write", changes={STEP_LENGTH: 0.44}, **trial)
            assert (error.kind, "move it away" in str(error)) == ("unavailable", True)
        assert bench.gait.node.written() == []
        assert "move it away" in client.call("robot.describe")["records"]["problem"]
        assert client.call("journal.tail", n=9)["entries"][0]["what"] == "undo file damaged"
        assert client.call("robot.stop", reason="all the same")["drives"]["left_knee"] == "confirmed"
    assert path.exists()


@contextlib.contextmanager
def no_renaming_of_undo() -> Iterator[None]:
    """It cannot be put aside."""
    replace = Path.replace

    def keeps_its_name(path: Path, target: Path) -> Path:
        if path.name == "undo.json":
            _no_space()
        return replace(path, target)

    with pytest.MonkeyPatch.context() as failing:
        failing.setattr("gateway.records.undo.Path.replace", keeps_its_name)
        yield
