"""A simulator that cannot keep its pace says so: what is slow, by how much, what to do; and seldom."""

from collections.abc import Iterator
from contextlib import closing

import pytest

from hil_sim.clock import SECOND_NS, Clock
from hil_sim.loop import Loop
from hil_sim.real_time import RealTimeCheck


class Slow:
    """A simulator that leaves out so much of each second, and computes for so much of it."""

    def __init__(self, speed: float | None = 1.0) -> None:
        self.said: list[str] = []
        self.now_ns = self.cpu_ns = 0
        self.loop = Loop(Clock(), speed)
        self.pace = RealTimeCheck(self.loop, self.said.append, lambda: self.now_ns, lambda: self.cpu_ns)

    def runs(self, seconds: int, lost: float = 0.0, busy: float = 0.5) -> None:
        for _ in range(seconds):
            self.now_ns += SECOND_NS
            self.cpu_ns += round(busy * SECOND_NS)
            self.loop.skipped_ns += round(lost * SECOND_NS)
            went_ns = round(max(0.0, (self.loop.speed or 1.0) - lost) * SECOND_NS)
            self.loop.clock.run_until(self.loop.clock.now_ns + went_ns)
            for look in self.loop._each_turn:
                look()


@pytest.fixture
def slow() -> Iterator[Slow]:
    made = Slow()
    with closing(made.loop):
        yield made


def test_what_is_slow_by_how_much_and_what_to_do_is_said_once(slow: Slow) -> None:
    slow.runs(30, lost=0.4)
    (words,) = slow.said
    assert "cannot keep real time: it went at 0.60 times real time in the last 3 s" in words
    assert "it got only 50 % of a core: end other programs" in words
    assert "SDO time-outs" in words


def test_one_that_is_too_much_for_its_core_is_told_another_remedy(slow: Slow) -> None:
    slow.runs(9, lost=0.4, busy=0.97)
    assert "it takes 97 % of a core itself: take a lower --speed" in slow.said[0]


@pytest.mark.parametrize("seconds", [200, 300])
def test_it_is_said_again_at_most_once_a_minute(slow: Slow, seconds: int) -> None:
    slow.runs(seconds, lost=0.3)
    assert 2 <= len(slow.said) <= seconds // 60 + 1


def test_that_it_is_over_is_said_once_and_no_flicker_is(slow: Slow) -> None:
    slow.runs(9, lost=0.3)
    for _ in range(3):
        slow.runs(9)
        slow.runs(9, lost=0.3)
    assert len(slow.said) == 2
    assert slow.said[1] == "it keeps its pace again"


def test_a_machine_that_slept_once_or_is_hardly_late_is_not_told_of(slow: Slow) -> None:
    slow.runs(9)
    slow.runs(1, lost=20.0)
    slow.runs(60, lost=0.02)
    assert slow.said == []


def test_by_the_speed_that_was_asked_for() -> None:
    fast = Slow(speed=4.0)
    with closing(fast.loop):
        fast.runs(9, lost=1.0)
    assert "cannot keep 4 times real time: it went at 3.00 times real time" in fast.said[0]


def test_as_fast_as_it_goes_is_never_too_slow() -> None:
    fast = Slow(speed=None)
    with closing(fast.loop):
        fast.runs(9, lost=1.0)
    assert fast.said == []
