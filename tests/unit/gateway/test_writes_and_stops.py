"""A stop and what is being written or taken back: which of them wins, and what stays as the stop set it."""

import time
from typing import Any

import pytest

from drivers.errors import DeviceAbort, DeviceTimeout
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import Bench
from tests.unit.gateway.tuned import (
    CYCLE,
    CYCLE_TIME,
    LONG_S,
    STEP,
    STEP_LENGTH,
    TOE_HEIGHT,
    Gate,
    Tuned,
    held,
    silent_but_for,
    u16,
)


def test_what_was_asked_for_before_a_stop_is_not_written_after_it(robot: Tuned, bench: Bench) -> None:
    gate = Gate(bench.gait.node, CYCLE[2])
    first = robot.ask(robot.writing({CYCLE_TIME: 1.1, STEP_LENGTH: 0.42}))
    gate.wait()
    second = robot.ask(robot.writing({TOE_HEIGHT: 0.09}))
    robot.do(lambda: None)
    robot.stop()
    gate.open()
    errors = [one.exception(WAIT_S) for one in (first, second)]
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


def test_a_node_that_reading_shows_not_to_be_trusted_is_not_written_to(robot: Tuned, bench: Bench) -> None:
    def find_two(_index: int) -> None:
        bench.gait.node.distrust = "two devices answer as node 16"

    bench.gait.node.before_upload = find_two
    assert robot.refused(robot.writing({STEP_LENGTH: 0.42})).kind == "not_allowed"
    assert robot.told("write") == []  # it was not even begun


@pytest.mark.usefixtures("impatient")
def test_a_node_that_has_not_come_up_is_not_written_to(robot: Tuned, bench: Bench) -> None:
    bench.gait.node.ready = False
    bench.gait.lost = "no frame of node 16"
    error = robot.refused(robot.writing({STEP_LENGTH: 0.42}))
    assert (error.kind, str(error)) == ("unavailable", "gait.step_length: no frame of node 16")
    assert bench.gait.node.log == []


@pytest.mark.usefixtures("impatient")
def test_a_node_that_is_late_to_come_up_is_waited_for(robot: Tuned, bench: Bench) -> None:
    bench.gait.node.ready, bench.gait.node.comes_up = False, True
    bench.gait.lost = "it was not read yet"
    written = robot.ask(robot.writing({STEP_LENGTH: 0.42}))
    until(lambda: time.monotonic_ns() > robot.component._warm_ns, "a cold start's time is over")
    robot.do(lambda: None)
    assert not written.done()
    bench.gait.node.ready, bench.gait.node.comes_up, bench.gait.lost = True, False, None
    assert written.result(WAIT_S).after == {STEP_LENGTH: 0.42}


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


def test_a_stop_with_nothing_to_claim_waits_for_no_write(controlled: Tuned, bench: Bench) -> None:
    gate = Gate(bench.gait.node, CYCLE[2])
    write = controlled.ask(controlled.writing({CYCLE_TIME: 1.1}))
    gate.wait()
    controlled.stop()
    assert controlled.tuning.claim().done()
    gate.open()
    write.exception(WAIT_S)


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
    error: Any = write.exception(WAIT_S)
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
