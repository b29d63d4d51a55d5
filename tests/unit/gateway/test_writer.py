"""The writer's thread: what is more urgent comes first, also in the middle of a long job."""

import threading
from collections.abc import Callable, Iterator

import pytest

from gateway.modules.control.writer import Turn, Writer
from gateway.wire.framing import RpcError
from tests.unit.gateway.harness import DEADLINE_S


@pytest.fixture
def writer() -> Iterator[Writer]:
    writer = Writer()
    yield writer
    writer.close()


@pytest.fixture
def done() -> list[str]:
    return []


def busy(writer: Writer, then: Callable[[], object] = lambda: None) -> threading.Event:
    """A write that goes on when the event is set."""
    begun, go_on = threading.Event(), threading.Event()

    def work() -> None:
        begun.set()
        assert go_on.wait(DEADLINE_S)
        then()

    writer.submit(work, Turn.WRITE)
    assert begun.wait(DEADLINE_S)
    return go_on


def test_a_claim_comes_before_a_trial_and_a_trial_before_a_write(writer: Writer, done: list[str]) -> None:
    go_on = busy(writer)
    turns = [Turn.WRITE, Turn.TRIAL, Turn.CLAIM, Turn.WRITE, Turn.TRIAL]
    jobs = [writer.submit(lambda i=i, t=t: done.append(f"{t.name} {i}"), t) for i, t in enumerate(turns)]  # type: ignore[misc]
    go_on.set()
    for job in jobs:
        job.result(DEADLINE_S)
    assert done == ["CLAIM 2", "TRIAL 1", "TRIAL 4", "WRITE 0", "WRITE 3"]


def test_a_long_write_lets_pass_what_is_more_urgent_and_nothing_else(writer: Writer, done: list[str]) -> None:
    def between() -> None:
        writer.let_pass(Turn.WRITE)
        done.append("the long write")

    go_on = busy(writer, between)
    jobs = [writer.submit(lambda t=t: done.append(t.name), t) for t in (Turn.WRITE, Turn.TRIAL, Turn.CLAIM)]  # type: ignore[misc]
    go_on.set()
    for job in jobs:
        job.result(DEADLINE_S)
    assert done == ["CLAIM", "TRIAL", "the long write", "WRITE"]


def test_a_job_that_fails_keeps_nothing_from_its_turn(writer: Writer) -> None:
    failing = writer.submit(lambda: 1 // 0, Turn.WRITE)
    assert isinstance(failing.exception(DEADLINE_S), ZeroDivisionError)
    assert writer.submit(lambda: 7, Turn.WRITE).result(DEADLINE_S) == 7


def test_what_was_submitted_before_the_end_is_done_and_nothing_after_it(writer: Writer) -> None:
    go_on = busy(writer)
    last = writer.submit(lambda: 7, Turn.WRITE)
    ending = threading.Thread(target=writer.close)
    ending.start()
    go_on.set()
    ending.join(DEADLINE_S)
    assert last.result(0) == 7
    with pytest.raises(RpcError, match="the gateway is ending"):
        writer.submit(lambda: 7, Turn.CLAIM).result(0)


def test_a_writer_that_never_wrote_ends() -> None:
    Writer().close()
