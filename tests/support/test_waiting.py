"""Waiting in tests: by the clock, whatever happens meanwhile."""

import time
from types import SimpleNamespace

import pytest

from tests.support import waiting
from tests.support.waiting import until


def test_what_comes_true_is_given() -> None:
    left = [3, 2, 1]
    assert until(lambda: not left and "over", step=left.pop) == "over"


def test_what_never_comes_true_fails_with_what_there_was_instead() -> None:
    began_s = time.monotonic()
    with pytest.raises(AssertionError, match=r"not in 0.05 s: \['this'\]"):
        until(lambda: False, lambda: ["this"], within_s=0.05)
    assert time.monotonic() - began_s >= 0.05


def test_however_often_it_was_looked_in_vain_only_time_ends_it() -> None:
    looks = iter(range(10_000))
    until(lambda: next(looks) >= 50, within_s=60.0)


def test_what_takes_long_to_look_at_is_left_for_a_second_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """A gateway that nobody asks for some seconds goes to sleep, and is not whole when it is asked again."""
    now_s = [0.0]
    pauses: list[float] = []
    clock = SimpleNamespace(monotonic=lambda: now_s[0], sleep=pauses.append)
    monkeypatch.setattr(waiting, "time", clock)

    def look() -> bool:
        now_s[0] += 0.1 if not pauses else 10.0
        return len(pauses) == 2

    waiting.until(look)
    assert pauses == [pytest.approx(0.4), waiting.PAUSE_S]


def test_what_came_true_while_nobody_looked_counts() -> None:
    """The process stood still beyond the deadline, as on a busy machine."""
    done: list[int] = []

    def stands_still() -> None:
        done.append(1)
        time.sleep(0.05)

    until(lambda: done, within_s=0.02, step=stands_still)
