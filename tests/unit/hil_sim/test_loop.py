"""The loop: simulated time follows real time in even steps."""

import selectors
from contextlib import closing

import pytest

from hil_sim import loop as loops
from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock
from hil_sim.loop import Loop

START_NS = 7_300_000_000


class RealTime:
    """Stands in for the machine's clock: each look at it costs time, as on a busy one."""

    def __init__(self, look_ns: int) -> None:
        self.now_ns, self._look_ns = START_NS, look_ns

    def monotonic_ns(self) -> int:
        self.now_ns += self._look_ns
        return self.now_ns

    def select(self, wait_s: float) -> list[tuple[selectors.SelectorKey, int]]:
        """Nothing comes from outside; waiting ends a little late."""
        self.now_ns += round(wait_s * SECOND_NS) + self._look_ns
        return []


def started(clock: Clock, speed: float, real: RealTime, monkeypatch: pytest.MonkeyPatch) -> Loop:
    loop = Loop(clock, speed)
    monkeypatch.setattr(loops, "time", real)
    monkeypatch.setattr(loop._selector, "select", real.select)
    return loop


@pytest.mark.parametrize("speed", [1.0, 0.25, 3.0])
@pytest.mark.parametrize("look_ns", [7_000, 130_001, 2_900_000])
def test_what_is_due_is_handled_at_even_steps_however_busy_the_machine_is(
    speed: float, look_ns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    step_ns = round(loops._STEP_NS * speed)
    turns: list[int] = []
    happened: list[int] = []
    with closing(started(clock, speed, RealTime(look_ns), monkeypatch)) as loop:
        loop.each_turn(lambda: turns.append(clock.now_ns))
        clock.every(4 * MILLISECOND_NS, lambda: happened.append(clock.now_ns))
        loop.run(until_ns=SECOND_NS // 5)
    assert happened == [4 * MILLISECOND_NS * number for number in range(1, 51)]
    assert turns[-1] == SECOND_NS // 5
    assert all(now_ns % step_ns == 0 for now_ns in turns[:-1])


def test_simulated_time_is_never_ahead_of_real_time(monkeypatch: pytest.MonkeyPatch) -> None:
    real = RealTime(90_000)
    clock = Clock()
    ahead: list[int] = []
    with closing(started(clock, 1.0, real, monkeypatch)) as loop:
        clock.every(MILLISECOND_NS, lambda: ahead.append(clock.now_ns - (real.now_ns - START_NS)))
        loop.run(until_ns=SECOND_NS // 10)
    assert max(ahead) <= 0


def test_what_a_sleeping_machine_missed_is_left_out_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    real = RealTime(50_000)
    clock = Clock()
    seen: list[int] = []

    def sleep() -> None:
        real.now_ns += 10 * SECOND_NS

    with closing(started(clock, 1.0, real, monkeypatch)) as loop:
        clock.after(50 * MILLISECOND_NS, sleep)
        clock.every(10 * MILLISECOND_NS, lambda: seen.append(clock.now_ns))
        loop.run(until_ns=SECOND_NS // 10)
        assert loop.skipped_ns == pytest.approx(10 * SECOND_NS, rel=0.05)
    assert seen == [10 * MILLISECOND_NS * number for number in range(1, 11)]
