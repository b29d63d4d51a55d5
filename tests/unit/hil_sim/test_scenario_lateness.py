"""When a computer was too slow to judge: measured on the loop and on the scheduler, never guessed."""

import os
import time
from contextlib import closing
from pathlib import Path

import pytest

from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock
from hil_sim.loop import Loop
from hil_sim.scenario.expectation import Timing, When
from hil_sim.scenario.lateness import Lateness, margin
from hil_sim.scenario.waiting import Waiting

WITHIN = Timing(When.WITHIN, 2.0, 8.0)
BETWEEN = Timing(When.BETWEEN, 2.0, 8.0)


class Bench:
    """A clock, and what was lost by then: simulated s → (simulator, gateway) in the look that ends there."""

    def __init__(self, lost: dict[float, tuple[float, float]]) -> None:
        self._lost = lost
        self._clock = Clock()
        self.lateness = Lateness(self._clock, lambda: self._now()[0], lambda: self._now()[1])
        self._clock.run_until(10 * SECOND_NS)

    def _now(self) -> tuple[float, float]:
        return self._lost.get(round(self._clock.now_s, 1), (0.0, 0.0))


@pytest.mark.parametrize(
    ("lost", "slow"),
    [
        ({}, False),
        ({4.0: (0.5, 0.0)}, False),  # a tenth of the window is no matter
        ({4.0: (0.7, 0.0)}, True),
        ({4.0: (0.4, 0.0), 5.0: (0.0, 0.3)}, True),  # both together
        ({1.0: (3.0, 0.0)}, False),  # before
        ({9.0: (3.0, 0.0)}, False),  # behind
        ({round(2 + tenth / 10, 1): (0.04, 0.04) for tenth in range(60)}, False),  # everyday milliseconds
    ],
)
def test_what_was_lost_in_the_window_counts_beyond_its_margin(
    lost: dict[float, tuple[float, float]], slow: bool
) -> None:
    assert bool(Bench(lost).lateness.doubt(WITHIN, 2.0, 8.0)) is slow


def test_a_moment_has_less_margin_than_a_window() -> None:
    assert margin(WITHIN) == pytest.approx(0.6)
    assert margin(BETWEEN) == margin(Timing(When.AT, 2.0, 8.0)) == 0.2
    assert margin(Timing(When.WITHIN, 2.0, 2.5)) == 0.2
    assert Bench({4.0: (0.3, 0.0)}).lateness.doubt(BETWEEN, 2.0, 8.0)
    assert not Bench({4.0: (0.3, 0.0)}).lateness.doubt(BETWEEN, 2.0, 3.0)  # it had failed before


def test_the_doubt_says_who_was_late_and_by_how_much() -> None:
    assert Bench({4.0: (0.7, 0.25)}).lateness.doubt(WITHIN, 2.0, 8.0) == (
        "this computer was too slow between 2 and 8 s: the simulator came 0.70 s late and the gateway waited "
        "0.25 s for a processor; up to 0.60 s would not matter"
    )


@pytest.mark.parametrize("blocked_ms", [120, 450])
def test_a_loop_that_is_kept_from_turning_knows_how_late_it_came(blocked_ms: int) -> None:
    """Beneath 0.2 s it catches up, beyond that it leaves time out: both are late."""
    clock = Clock()
    with closing(Loop(clock)) as loop:
        clock.every(10 * MILLISECOND_NS, lambda: None)
        clock.at(50 * MILLISECOND_NS, lambda: time.sleep(blocked_ms / 1000))
        loop.run(150 * MILLISECOND_NS)
        late_ms = loop.take_late_ns() / MILLISECOND_NS
        assert late_ms > 0.8 * blocked_ms
        assert loop.take_late_ns() == 0


def test_waiting_for_what_is_due_later_is_not_late() -> None:
    clock = Clock()
    with closing(Loop(clock)) as loop:
        clock.at(400 * MILLISECOND_NS, lambda: None)
        loop._note_late(90 * MILLISECOND_NS)
        assert loop.take_late_ns() == 0
        loop._note_late(430 * MILLISECOND_NS)
        assert loop.take_late_ns() == 30 * MILLISECOND_NS


def test_as_fast_as_it_goes_nothing_is_late() -> None:
    clock = Clock()
    with closing(Loop(clock, None)) as loop:
        clock.every(MILLISECOND_NS, lambda: None)
        loop.run(SECOND_NS)
        assert loop.take_late_ns() == 0


def task(proc: Path, number: int, waited_ns: int) -> None:
    folder = proc / "7" / "task" / str(number)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "schedstat").write_text(f"123456 {waited_ns} 8\n", encoding="ascii")


def test_the_longest_wait_of_a_thread_since_the_last_look(tmp_path: Path) -> None:
    task(tmp_path, 7, 5_000_000_000)
    waiting = Waiting(7, tmp_path)
    task(tmp_path, 7, 5_100_000_000)
    task(tmp_path, 8, 300_000_000)  # a thread that has begun since
    assert waiting.take_s() == pytest.approx(0.3)
    task(tmp_path, 7, 5_250_000_000)
    assert waiting.take_s() == pytest.approx(0.15)
    assert waiting.take_s() == 0


def test_where_the_kernel_does_not_tell_nothing_was_waited_for(tmp_path: Path) -> None:
    assert Waiting(7, tmp_path).take_s() == 0
    (tmp_path / "7" / "task" / "7").mkdir(parents=True)
    (tmp_path / "7" / "task" / "7" / "schedstat").write_text("nothing\n", encoding="ascii")
    assert Waiting(7, tmp_path).take_s() == 0


def test_a_process_of_this_computer_can_be_looked_at() -> None:
    assert Waiting(os.getpid()).take_s() >= 0
