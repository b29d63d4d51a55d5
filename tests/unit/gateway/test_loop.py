"""The loop: timers in order, callbacks from other threads never lost, errors that do not end it."""

import os
import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from gateway.process import loop as loops
from gateway.process.loop import HANGUP, READ, WRITE, Loop
from tests.unit.gateway.harness import until


@pytest.fixture(params=["epoll", "poll"])
def loop(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Loop]:
    """As it is here, and as it is where there is no epoll."""
    if request.param == "poll":
        monkeypatch.setattr(loops, "_POLL", loops.Poll)
    loop = Loop()
    yield loop
    loop.close()


@pytest.fixture
def running(loop: Loop) -> Iterator[Loop]:
    thread = threading.Thread(target=loop.run)
    thread.start()
    yield loop
    loop.stop()
    thread.join()


def test_timers_run_in_the_order_of_their_times(loop: Loop, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[str] = []
    now_ns = time.monotonic_ns()
    with monkeypatch.context() as clock:
        clock.setattr(time, "monotonic_ns", lambda: now_ns)  # all of them at one instant
        loop.call_later(0.03, lambda: ran.append("c"))
        loop.call_later(0.04, loop.stop)
        loop.call_later(0.01, lambda: ran.append("a"))
        loop.call_later(0.02, lambda: ran.append("no")).cancel()
        loop.call_later(0.02, lambda: ran.append("b"))
    loop.run()
    assert ran == ["a", "b", "c"]


def test_an_error_in_a_callback_is_logged_and_the_loop_goes_on(
    running: Loop, caplog: pytest.LogCaptureFixture
) -> None:
    done = threading.Event()

    def fail() -> None:
        raise ValueError("oops")

    running.post(fail)
    running.post(done.set)
    until(done.is_set, "the next callback runs")
    assert "oops" in caplog.text


def test_a_callback_posted_while_the_loop_wakes_up_is_not_lost(
    loop: Loop, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The race of a wake-up that is read together with an earlier one."""
    read = os.read
    posts: list[Callable[[], object]] = [lambda: None]

    def read_and_be_posted_to(descriptor: int, size: int) -> bytes:
        if posts:
            loop.post(posts.pop())
        return read(descriptor, size)

    ran: list[int] = []
    loop.post(lambda: None)
    monkeypatch.setattr(os, "read", read_and_be_posted_to)
    loop._turn()
    monkeypatch.undo()
    loop.post(lambda: ran.append(1))
    assert read(loop._wake_reader, 10), "the loop is woken for what was posted last"
    loop._turn()
    assert ran == [1]


def test_every_callback_of_many_threads_runs_once(running: Loop) -> None:
    count = 4_000
    ran: list[int] = []

    def post() -> None:
        for _ in range(count):
            running.post(lambda: ran.append(1))

    threads = [threading.Thread(target=post) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    until(lambda: len(ran) == 4 * count, "all have run")


def test_call_runs_at_once_in_the_loops_own_thread(running: Loop) -> None:
    order: list[str] = []
    done = threading.Event()

    def inside() -> None:
        running.call(lambda: order.append("called"))
        order.append("after")
        done.set()

    running.call(inside)
    until(done.is_set, "it has run")
    assert order == ["called", "after"]


def test_a_file_is_watched_for_what_is_asked_and_its_end_is_told_in_any_case(loop: Loop) -> None:
    ours, other = socket.socketpair()
    told: list[int] = []
    with ours:
        loop.call_later(1000.0, lambda: None)  # it waits for no time to pass
        loop.watch(ours, READ, told.append)
        other.send(b"x")
        loop._turn()
        loop.watch(ours, READ | WRITE, told.append)
        loop._turn()
        loop.watch(ours, HANGUP, told.append)
        loop.post(lambda: None)
        loop._turn()
        assert told == [READ, READ | WRITE]
        other.close()
        loop._turn()
        assert told[2] & HANGUP
        loop.watch(ours, 0, told.append)
        loop.post(lambda: None)
        loop._turn()
        assert len(told) == 3


def test_timers_that_are_set_anew_again_and_again_do_not_pile_up() -> None:
    loop = Loop()
    kept = loop.call_later(1000.0, lambda: None)
    for _ in range(100_000):
        loop.call_later(300.0, lambda: None).cancel()
    assert len(loop._timers) < 1000
    assert kept.callback is not None
    loop.close()
