"""Resource-processing: rings, top consumers, leaks that are leaks, regressions that are regressions."""

import random
import re
import tracemalloc
from collections.abc import Sequence

import numpy as np
import pytest

from gateway.wire.messages import CpuUse, GatewayUse, MemoryUse, ProcessUse, ResourceSnapshot
from server_gui.core.processing.history import COARSE_ROWS, FINE_ROWS
from server_gui.core.processing.regression import Regression, SessionUse, regressions
from server_gui.core.processing.resource import PROCESSES, ResourceProcessing, leaking

MIB = 1 << 20


def look(second: float, *processes: ProcessUse, cpu: float | None = 10.0) -> ResourceSnapshot:
    return ResourceSnapshot(
        round(second * 1e9),
        CpuUse(cpu, [cpu], [0.5, 0.5, 0.5]),
        MemoryUse(1000 * MIB, 600 * MIB, 400 * MIB, 0),
        GatewayUse(1.5, 20 * MIB),
        list(processes),
    )


# --- usage over time


def test_the_cpu_of_processes_is_told_at_the_looks_that_saw_them() -> None:
    resource = ResourceProcessing()
    resource.take(look(0, ProcessUse(1, "old", 50.0, MIB)))
    resource.take(look(1, ProcessUse(1, "old", 60.0, MIB), ProcessUse(2, "new", 20.0, MIB)))
    resource.take(look(2, ProcessUse(1, "old", None, MIB), ProcessUse(2, "new", 30.0, MIB)))
    top = resource.top(2)
    times, columns = resource.over_time(top)
    assert [one.name for one in top] == ["old", "new"]
    assert times.tolist() == [0.0, 1.0, 2.0]
    np.testing.assert_array_equal(columns, [[50.0, 60.0, np.nan], [np.nan, 20.0, 30.0]])


def test_a_robot_that_was_started_again_begins_its_looks_anew() -> None:
    resource = ResourceProcessing()
    for second in (100, 101, 5):
        resource.take(look(second, ProcessUse(1, "p", 1.0, MIB)))
    times, (column,) = resource.over_time(resource.top(1))
    assert (times.tolist(), column.tolist()) == ([5.0], [1.0])


def test_usage_is_kept_second_by_second_and_then_minute_by_minute() -> None:
    resource = ResourceProcessing()
    for second in range(3601):
        resource.take(look(second, cpu=float(second % 60)))
    recent, hours = resource.history.recent(), resource.history.hours()
    assert recent.shape == (FINE_ROWS, 1 + len(resource.history.columns))
    assert recent[-1][0] == 3600.0
    assert np.all(np.diff(recent[:, 0]) == 1.0)
    assert len(hours) == 60
    assert hours[:, 1] == pytest.approx(29.5)


def test_what_is_not_known_is_no_number() -> None:
    resource = ResourceProcessing()
    resource.take(look(0, cpu=None))
    assert np.isnan(resource.history.recent()[0][1])


# --- top consumers


def test_top_consumers_are_those_of_the_last_minute() -> None:
    resource = ResourceProcessing()
    for second in range(120):
        burst = ProcessUse(1, "burst", 100.0 if second < 50 else 1.0, 5 * MIB)
        steady = ProcessUse(2, "steady", 20.0, 50 * MIB)
        gone = (ProcessUse(3, "gone", 90.0, 500 * MIB),) if second < 30 else ()
        resource.take(look(second, burst, steady, *gone))
    assert [one.name for one in resource.top()] == ["steady", "burst"]
    assert resource.top()[0].cpu_percent == pytest.approx(20.0)
    assert [one.name for one in resource.top(1, by="memory")] == ["steady"]
    with pytest.raises(ValueError, match="by cpu or memory, not by 'pid'"):
        resource.top(by="pid")


# --- leaks


def minutes(count: int, bytes_of: Sequence[float]) -> list[tuple[float, float]]:
    return [(60.0 * minute, bytes_of[minute]) for minute in range(count)]


def test_a_leak_is_named_with_its_slope() -> None:
    source, resource = random.Random(3), ResourceProcessing()
    for second in range(0, 5400, 5):
        leaky = ProcessUse(7, "leaky", 1.0, round((100 + 12.0 * second / 3600 + source.gauss(0, 0.5)) * MIB))
        noisy = ProcessUse(8, "noisy", 1.0, round((100 + source.gauss(0, 4)) * MIB))
        resource.take(look(second, leaky, noisy))
    (leak,) = resource.leaks()
    assert (leak.pid, leak.name) == (7, "leaky")
    assert leak.slope.value == pytest.approx(12 * MIB, rel=0.1)
    assert leak.slope.low < leak.slope.value < leak.slope.high
    assert leak.text.startswith("leaky (7) grows by 1")


@pytest.mark.parametrize("seed", range(10))
def test_memory_that_only_varies_does_not_leak(seed: int) -> None:
    source = random.Random(seed)
    assert leaking(minutes(90, [100 * MIB + source.gauss(0, 3 * MIB) for _ in range(90)])) is None


def test_a_cache_that_fills_once_does_not_leak() -> None:
    step = [(100 + (20 if minute >= 30 else 0)) * MIB for minute in range(90)]
    full = [(100 + 40 * (1 - 0.9**minute)) * MIB for minute in range(90)]
    assert leaking(minutes(90, step)) is None
    assert leaking(minutes(90, full)) is None


def test_a_process_that_is_gone_is_no_leak_any_more() -> None:
    resource = ResourceProcessing()
    for second in range(0, 3600, 10):
        resource.take(look(second, ProcessUse(7, "leaky", 1.0, 100 * MIB + second * 10_000)))
    assert resource.leaks()
    resource.take(look(3700.0))
    assert resource.leaks() == []


def test_memory_is_bounded_over_eight_hours_of_processes_that_come_and_go() -> None:
    resource = ResourceProcessing()

    def go_on(seconds: range) -> int:
        for second in seconds:
            new = [ProcessUse(second * 4 + n, f"job {n}", 1.0, MIB) for n in range(4)]
            resource.take(look(second, *new, ProcessUse(1, "init", 0.1, MIB)))
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        after_some, after_more = go_on(range(0, 14_400, 12)), go_on(range(14_400, 28_800, 12))
    finally:
        tracemalloc.stop()
    assert len(resource.history.hours()) <= COARSE_ROWS
    assert len(resource._processes) <= PROCESSES
    assert after_more - after_some < 100_000


# --- regressions


def session(version: str, seed: int, **medians: tuple[float, float]) -> SessionUse:
    """Half an hour; per process its CPU (percent) and memory (MiB)."""
    source = random.Random(seed)
    looks = [
        (
            second * 5.0,
            [
                {
                    "name": name,
                    "cpu_percent": cpu * source.uniform(0.8, 1.2),
                    "memory_bytes": round(memory * MIB * source.uniform(0.97, 1.03)),
                }
                for name, (cpu, memory) in medians.items()
            ],
        )
        for second in range(360)
    ]
    return SessionUse.of(version, looks)


def test_what_costs_more_with_a_new_version_is_named() -> None:
    before = [session("1.4", seed, gateway=(2.0, 20.0), vision=(30.0, 200.0)) for seed in range(2)]
    after = [session("1.5", seed + 9, gateway=(2.0, 20.0), vision=(45.0, 200.0)) for seed in range(2)]
    (found,) = regressions(before, after)
    assert (found.process, found.measure) == ("vision", "cpu_percent")
    assert (found.version_before, found.version_after) == ("1.4", "1.5")
    assert found.after / found.before == pytest.approx(1.5, rel=0.05)
    assert re.fullmatch(
        r"vision uses \d\d % more with 1\.5: \d+\.\d → \d+\.\d % of a core against 1\.4 \(p = \S+\)",
        found.text,
    )


def test_the_same_software_is_no_regression() -> None:
    before, after = (
        [session(version, seed, gateway=(2.0, 20.0), vision=(30.0, 200.0)) for seed in seeds]
        for version, seeds in (("1.4", (1, 2)), ("1.5", (3, 4)))
    )
    assert regressions(before, after) == []


def test_sessions_that_differ_among_themselves_prove_nothing() -> None:
    before = [session("1", seed, vision=(cpu, 200.0)) for seed, cpu in enumerate((20.0, 60.0, 30.0))]
    after = [session("2", seed + 9, vision=(cpu, 200.0)) for seed, cpu in enumerate((35.0, 60.0, 40.0))]
    assert regressions(before, after) == []


def test_what_got_better_or_is_new_is_no_regression() -> None:
    before = [session("1", 1, gateway=(20.0, 100.0))]
    after = [session("2", 2, gateway=(5.0, 50.0), planner=(90.0, 900.0))]
    assert regressions(before, after) == []


def test_processes_of_one_name_count_together() -> None:
    looks = [(0.0, [{"name": "worker", "cpu_percent": 10.0, "memory_bytes": MIB} for _ in range(3)])]
    use = SessionUse.of("1", looks)
    assert use.processes["worker"]["cpu_percent"] == pytest.approx([30.0])


def test_a_process_that_used_nothing_before_has_words_too() -> None:
    text = Regression("idle", "cpu_percent", "1", "2", 0.0, 5.0, 1e-6).text
    assert text == "idle uses more with 2: 0.0 → 5.0 % of a core against 1 (p = 1e-06)"
