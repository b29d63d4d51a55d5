"""Whoever waits for something that other threads put in is let go in time, and gets all of it in order."""

import itertools
import queue
import threading
from types import SimpleNamespace

import pytest

from drivers import inbox
from drivers.inbox import Inbox
from tests.support.waiting import WAIT_S

MOST = 200


def test_a_wait_ends_though_this_computer_stood_still_in_the_midst_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At every look at the clock; its lock is free as an item was taken without a wait."""
    waited: Inbox[int] = Inbox()
    waited.put(1)
    assert waited.get(timeout=WAIT_S) == 1
    monkeypatch.setattr(inbox, "time", SimpleNamespace(monotonic=itertools.count(0.0, 1e-6).__next__))
    for timeout in (0.0, 1e-6, 2e-6, 3e-6, -1.0):
        with pytest.raises(queue.Empty):
            waited.get(timeout=timeout)


def test_what_has_come_is_taken_however_late_one_looks() -> None:
    late: Inbox[int] = Inbox()
    late.put(1)
    late.put(2)
    assert [late.get(timeout=0.0), late.get(timeout=-1.0)] == [1, 2]
    assert late.empty()


def test_all_that_several_put_is_taken_each_ones_in_order() -> None:
    shared: Inbox[tuple[int, int]] = Inbox()

    def put_all(who: int) -> None:
        for n in range(MOST):
            shared.put((who, n))

    threads = [threading.Thread(target=put_all, args=(who,)) for who in range(4)]
    for thread in threads:
        thread.start()
    taken = [shared.get(timeout=WAIT_S) for _ in range(4 * MOST)]
    for thread in threads:
        thread.join()
    assert shared.qsize() == 0
    for who in range(4):
        assert [n for whose, n in taken if whose == who] == list(range(MOST))


def test_nothing_in_it_is_said_at_once() -> None:
    empty: Inbox[int] = Inbox()
    with pytest.raises(queue.Empty):
        empty.get_nowait()
