"""A recipe's grid: the same live and over a recording, gaps told, values never older than they may be."""

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ml.features.recipe import Recipe
from ml.serving.grid import OLDEST_NS, Grid, on_grid

MS = 1_000_000
RECIPE = Recipe("of three", 50, 4, ("a", "b", "c"), lambda windows: windows.astype(np.float32)[..., -1])
Row = tuple[int, tuple[float | None, ...]]


def live(rows: Sequence[Row]) -> list[tuple[int, list[float]]]:
    grid = Grid(RECIPE)
    found = itertools.chain.from_iterable(grid.push(stamp_ns, values) for stamp_ns, values in rows)
    return [(grid_ns, sample.tolist()) for grid_ns, sample in found]


def replayed(rows: Sequence[Row]) -> list[tuple[int, list[float]]]:
    stamps_ns = np.array([stamp_ns for stamp_ns, _ in rows], dtype=np.int64)
    values: npt.NDArray[np.float64] = np.array([values for _, values in rows], dtype=np.float64).reshape(
        -1, 3
    )
    pieces = on_grid(RECIPE, stamps_ns, values)
    return [
        (int(at), sample.tolist())
        for grid, samples in pieces
        for at, sample in zip(grid, samples, strict=True)
    ]


def test_points_are_multiples_of_the_period_with_the_newest_values_not_after_them() -> None:
    rows: list[Row] = [(at * MS, (at, -at, 0.5)) for at in range(7, 100, 10)]
    assert live(rows) == [(at * MS, [at - 3.0, 3.0 - at, 0.5]) for at in (20, 40, 60, 80)]


def test_a_value_at_the_point_itself_counts_and_settles_it() -> None:
    assert live([(40 * MS, (1.0, 2.0, 3.0))]) == [(40 * MS, [1.0, 2.0, 3.0])]


def test_a_channel_that_is_missing_too_long_is_a_gap_and_no_old_value() -> None:
    whole = [(at * MS, (1.0, 2.0, 3.0)) for at in range(0, 100, 10)]
    without = [(at * MS, (1.0, None, 3.0)) for at in range(100, 400, 10)]
    again = [(at * MS, (1.0, 9.0, 3.0)) for at in range(400, 500, 10)]
    found = live([*whole, *without, *again])
    points = [at // MS for at, _ in found]
    assert points == [*range(0, 200, 20), *range(400, 500, 20)]  # until 100 ms after its last one at 90 ms
    assert {values[1] for at, values in found if at < 400 * MS} == {2.0}


@pytest.mark.parametrize("nothing", [None, float("nan"), float("inf")])
def test_what_is_not_finite_is_missing(nothing: float | None) -> None:
    assert not live([(at * MS, (1.0, nothing, 3.0)) for at in range(0, 1000, 10)])


def test_a_silence_of_centuries_costs_nothing() -> None:
    rows: list[Row] = [(0, (1.0, 2.0, 3.0)), (2**62, (1.0, 2.0, 3.0)), (2**62 + 20 * MS, (1.0, 2.0, 3.0))]
    assert live(rows) == replayed(rows)
    assert len(live(rows)) == 7


def test_one_source_after_another_gives_what_rows_of_all_give() -> None:
    """With `rate_hz = 0` each component's rows come by themselves, in batches that overtake each other."""
    by_source: list[Row] = []
    for begin in range(0, 1000, 50):
        for channel in (2, 0, 1):
            for at in range(begin, begin + 50, 10):
                values: list[float | None] = [None] * 3
                values[channel] = float(at + channel)
                by_source.append((at * MS, tuple(values)))
    whole: list[Row] = [(at * MS, (at, at + 1.0, at + 2.0)) for at in range(0, 1000, 10)]
    assert live(by_source) == live(whole) == replayed(by_source)


def test_without_rows_or_without_a_channel_a_recording_has_no_pieces() -> None:
    assert not replayed([])
    assert not replayed([(0, (1.0, None, 2.0)), (20 * MS, (1.0, None, 2.0))])


value = st.one_of(st.none(), st.floats(-10, 10), st.just(float("nan")))
step = st.one_of(st.integers(0, 30 * MS), st.integers(0, 3), st.integers(80 * MS, 400 * MS))


@given(
    start_ns=st.integers(-(2**40), 2**40),
    found=st.lists(st.tuples(step, st.integers(0, 2), value), max_size=80),
    late=st.tuples(*[st.integers(0, OLDEST_NS)] * 3),
)
def test_live_and_replay_agree_sample_by_sample_however_late_a_source_is_behind_another(
    start_ns: int, found: list[tuple[int, int, float | None]], late: tuple[int, ...]
) -> None:
    stamps = itertools.accumulate((step for step, _, _ in found), initial=start_ns)
    rows = [
        (stamp_ns + late[channel], (stamp_ns, tuple(one if at == channel else None for at in range(3))))
        for stamp_ns, (_, channel, one) in zip(stamps, found, strict=False)
    ]
    arrived = [row for _, row in sorted(rows, key=lambda row: row[0])]
    assert live(arrived) == replayed(arrived)


@given(start_ns=st.integers(0, 2**40), found=st.lists(st.tuples(step, value, value, value), max_size=80))
@example(start_ns=0, found=[(0, 0.0, 0.0, 1.0), (0, None, None, 0.0)])  # two values of one instant
def test_live_and_replay_agree_sample_by_sample_where_a_row_is_a_tick(
    start_ns: int, found: list[tuple[int, float | None, float | None, float | None]]
) -> None:
    stamps = itertools.accumulate((step for step, *_ in found), initial=start_ns)
    rows: list[Row] = [(stamp_ns, (a, b, c)) for stamp_ns, (_, a, b, c) in zip(stamps, found, strict=False)]
    assert live(rows) == replayed(rows)
