"""Trials, take-overs, confirmations, ends and the gateway's end, one in the middle of another."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from drivers.errors import DeviceTimeout
from gateway.modules.control.ledger import WriteLedger
from tests.unit.gateway.harness import DEADLINE_S, Bench, until
from tests.unit.gateway.tuned import (
    CYCLE,
    CYCLE_TIME,
    LONG_S,
    MAX_TORQUE,
    STEP,
    STEP_LENGTH,
    TOE_HEIGHT,
    TORQUE,
    Gate,
    Tuned,
    held,
    silent_but_for,
    tuned,
    u16,
)


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
    error: Any = write.exception(DEADLINE_S)
    assert (error.kind, "its trial is over already: guard rule tilt: too far" in str(error)) == (
        "rolled_back",
        True,
    )
    assert (held(bench, CYCLE), robot.undos()) == (1200, [])


def test_a_trial_that_all_are_taken_back_after_is_written_and_before_it_begins_is_too(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = WriteLedger.done

    def slow(ledger: WriteLedger) -> None:
        done(ledger)
        robot.do(lambda: robot.tuning.trials.revert_of(robot.session, "the lease has ended"))

    monkeypatch.setattr(WriteLedger, "done", slow)
    robot.write({CYCLE_TIME: 1.3}, LONG_S)
    until(lambda: robot.trials() == [], "taken back")
    assert held(bench, CYCLE) == 1200
    assert robot.told("taken back")[0]["reason"] == "the lease has ended"


def test_a_lease_that_ends_does_not_end_what_is_no_trial(robot: Tuned, bench: Bench) -> None:
    gate = Gate(bench.gait.node, CYCLE[2])
    write = robot.ask(robot.writing({CYCLE_TIME: 1.3}))
    gate.wait()
    robot.do(lambda: robot.tuning.trials.revert_of(robot.session, "the lease has ended"))
    gate.open()
    write.result(DEADLINE_S)
    assert held(bench, CYCLE) == 1300


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


def test_what_could_not_be_taken_back_for_a_failure_of_our_own_is_tried_again_and_not_confirmed(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = robot.write({CYCLE_TIME: 1.3}, LONG_S)
    with monkeypatch.context() as failing:
        failing.setattr(
            "gateway.modules.control.trial_jobs.Attempt.take_back", lambda _self, _changes: 1 // 0
        )
        assert robot.refused(lambda: robot.tuning.trials.revert(write)).kind == "rollback_failed"
        error = robot.refused(lambda: robot.tuning.trials.confirm(write))
        assert (error.kind, held(bench, CYCLE)) == ("unknown_name", 1300)
    until(lambda: held(bench, CYCLE) == 1200, "taken back")


def test_a_confirmation_that_was_asked_for_first_wins(robot: Tuned, bench: Bench) -> None:
    write = robot.write({CYCLE_TIME: 1.3}, LONG_S)

    def both() -> list[Any]:
        return [robot.tuning.trials.confirm(write), robot.tuning.trials.revert(write)]

    confirmed, reverted = robot.do(both)
    assert confirmed.result(DEADLINE_S).values == {CYCLE_TIME: 1.3}
    assert "it was confirmed" in str(reverted.exception(DEADLINE_S))
    assert held(bench, CYCLE) == 1300


def test_a_gateway_that_ends_takes_back_what_is_being_written_and_answers_who_waits(
    calm: Bench, tmp_path: Path
) -> None:
    with tuned(tmp_path) as robot:
        trial = robot.write({MAX_TORQUE: 50}, LONG_S)
        calm.left.node.ready = False
        gate = Gate(calm.gait.node, CYCLE[2])
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
    assert calm.gait.node.written() == [(CYCLE[2], u16(1100)), (CYCLE[2], u16(1200))]
    calm.left.node.ready = True
    with tuned(tmp_path):
        until(lambda: held(calm, TORQUE) == 1000, "taken back by the next")


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


def test_a_dead_node_is_asked_once_in_an_attempt_whatever_is_to_be_taken_back(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.modules.control.trials.FIRST_RETRY_S", 100.0)
    write = robot.write({STEP_LENGTH: 0.42, CYCLE_TIME: 1.1, TOE_HEIGHT: 0.09}, LONG_S)
    bench.gait.node.before_upload = silent_but_for(0)
    bench.gait.node.log.clear()
    assert robot.refused(lambda: robot.tuning.trials.revert(write)).kind == "rollback_failed"
    assert len(bench.gait.node.log) == 2  # the second time with more patience


def test_several_dead_nodes_take_no_longer_than_one(robot: Tuned, bench: Bench) -> None:
    """The first does not answer before the second was asked."""
    write = robot.write({MAX_TORQUE: 50, CYCLE_TIME: 1.3}, LONG_S)
    first: Future[Any] = Future()

    def silent(_job: object) -> Any:
        return first

    def silences(_job: object) -> Any:
        if not first.done():
            first.set_exception(DeviceTimeout("no answer"))
        return first

    with pytest.MonkeyPatch.context() as failing:
        failing.setattr(bench.gait.node, "run", silent)
        failing.setattr(bench.left.node, "run", silences)
        assert robot.refused(lambda: robot.tuning.trials.revert(write)).kind == "rollback_failed"
    assert not first.cancelled()
    until(lambda: (held(bench, CYCLE), held(bench, TORQUE)) == (1200, 1000), "taken back")


def test_what_is_not_waited_for_any_more_is_not_sent_later(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The device is busy with something urgent for longer than the writer waits."""
    monkeypatch.setattr("gateway.modules.control.objects.ANSWER_S", 0.05)
    asked: list[Callable[[], str | None]] = []

    def hang(*_given: Any, permitted: Callable[[], str | None], **_named: Any) -> Any:
        asked.append(permitted)
        return Future()

    bench.gait.node.download = hang  # type: ignore[assignment,method-assign]
    error = robot.refused(robot.writing({CYCLE_TIME: 1.1}))
    assert (error.kind, error.data.outcome) == ("device_timeout", {CYCLE_TIME: "unchanged"})
    assert asked[0]() == "nobody waits for it any more"
