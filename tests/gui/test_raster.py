"""Curves as pixels: in their place, joined, without a spike lost, and not drawn where nothing is known."""

import itertools
import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server_gui.views.widgets.raster import Floats, Inks, Pixels, Strip, View

INK = 0xFF112233


def drawn(times: Floats, values: Floats, view: View, *, thin: bool = False) -> Pixels:
    strip = Strip()
    strip.draw("robot", view, times, [values], Inks((INK,), (thin,)))
    return unrolled(strip)


def unrolled(strip: Strip) -> Pixels:
    """The picture as it is shown: the newest column at the right."""
    return np.roll(strip.pixels, -strip.seam, axis=1)


def columns(pixels: Pixels) -> npt.NDArray[np.bool_]:
    """Which columns have something in them."""
    return np.array([column.any() for column in pixels.T], np.bool_)


VIEW = View(10.0, -1.0, 1.0, 200, 101)


@pytest.mark.parametrize("points", [2, 50, 199, 1_000, 100_000])
def test_a_level_line_is_one_row_whatever_it_is_made_of(points: int) -> None:
    seen = drawn(np.linspace(-10, 0, points), np.zeros(points), VIEW)
    assert np.flatnonzero(seen.any(axis=1)).tolist() == [50]
    assert seen.any(axis=0).all()


@pytest.mark.parametrize("points", [2, 30, 3_000])
def test_a_slope_goes_from_corner_to_corner_without_a_hole(points: int) -> None:
    times = np.linspace(-10, 0, points)
    seen = drawn(times, times / 5 + 1, VIEW)
    assert seen[100, 0]
    assert seen[0, 199]
    assert seen.any(axis=0).all()
    rows = [np.flatnonzero(column) for column in seen.T]
    assert all(after.max() >= before.min() - 1 for before, after in itertools.pairwise(rows))


def test_no_spike_is_lost_among_many_points() -> None:
    values = np.zeros(50_000)
    values[12_345], values[40_001] = 0.9, -0.9
    seen = drawn(np.linspace(-10, 0, 50_000), values, VIEW)
    assert (seen[5] != 0).sum() == 1
    assert (seen[95] != 0).sum() == 1


def test_what_is_missing_leaves_a_hole() -> None:
    values = np.zeros(1_000)
    values[400:600] = np.nan
    seen = columns(drawn(np.linspace(-10, 0, 1_000), values, VIEW))
    assert not seen[82:118].any()
    assert seen[:79].all()
    assert seen[121:].all()


def test_nothing_known_draws_nothing() -> None:
    assert not drawn(np.linspace(-10, 0, 500), np.full(500, np.nan), VIEW).any()
    assert not drawn(np.zeros(0), np.zeros(0), VIEW).any()


def test_what_begins_later_is_not_drawn_before() -> None:
    seen = columns(drawn(np.linspace(-5, 0, 100), np.zeros(100), VIEW))
    assert not seen[:99].any()
    assert seen[101:].all()


def test_what_lies_outside_the_range_is_not_drawn_at_its_edge() -> None:
    assert not drawn(np.linspace(-10, 0, 500), np.full(500, 3.0), VIEW).any()


def test_a_thin_line_is_as_whole_as_any_other() -> None:
    times, values = np.linspace(-10, 0, 500), np.sin(np.linspace(0, 20, 500)) / 2
    assert (drawn(times, values, VIEW, thin=True) == drawn(times, values, VIEW)).all()


rises = st.lists(st.floats(0.001, 0.4), min_size=2, max_size=200)
heights = st.one_of(st.floats(-1.5, 1.5), st.just(math.nan))


def test_no_line_is_drawn_over_what_is_missing_between_two_columns() -> None:
    seen = drawn(
        np.array([0.34, 0.41, 0.66, 0.78]), np.array([-1.0, np.nan, np.nan, 1.0]), View(3.0, -1.0, 1.0, 7, 50)
    )
    assert not seen[5:45].any()


def test_a_bold_curve_grows_from_what_the_column_before_was_joined_to() -> None:
    steps = [0.25, 0.375, 0.1875, *[0.25] * 7]
    bold = np.array([np.nan, 0, 1, 0, 0, 0, 0, 0, 0, 0])
    other = np.array([0.0, np.nan, 0, np.nan, np.nan, 0, np.nan, np.nan, 0, np.nan])
    same_bit_by_bit(np.cumsum(steps), [bold, other], [5, 6], 7)


def same_bit_by_bit(times: Floats, curves: list[Floats], ends: list[int], width: int) -> None:
    view, inks = View(3.0, -1.0, 1.0, width, 50), Inks((INK, INK + 1), (False, True), 1)
    bit_by_bit, at_once = Strip(), Strip()
    for end in ends:
        bit_by_bit.draw("robot", view, times[:end], [curve[:end] for curve in curves], inks)
    at_once.draw("robot", view, times[: ends[-1]], [curve[: ends[-1]] for curve in curves], inks)
    assert np.array_equal(unrolled(bit_by_bit), unrolled(at_once))


@given(rises, st.data(), st.sampled_from([7, 40, 300]))
def test_what_is_drawn_bit_by_bit_is_what_is_drawn_at_once(
    steps: list[float], data: st.DataObject, width: int
) -> None:
    times = np.cumsum(steps)
    curves = [
        np.array(data.draw(st.lists(heights, min_size=len(times), max_size=len(times)))) for _ in range(2)
    ]
    ends = sorted(data.draw(st.sets(st.integers(2, len(times)), min_size=1, max_size=6)))
    same_bit_by_bit(times, curves, ends, width)


def test_another_robot_leaves_nothing_of_the_one_before() -> None:
    strip, times = Strip(), np.linspace(0, 10, 1_000)
    strip.draw("one", VIEW, times, [np.full(1_000, 0.9)], Inks((INK,), (False,)))
    strip.draw("other", VIEW, times + 0.1, [np.zeros(1_000)], Inks((INK,), (False,)))
    assert np.flatnonzero(strip.pixels.any(axis=1)).tolist() == [50]


def test_nothing_new_is_nothing_to_draw() -> None:
    strip, times = Strip(), np.linspace(0, 10, 1_000)
    inks = Inks((INK,), (False,))
    assert strip.draw("robot", VIEW, times, [np.zeros(1_000)], inks)
    assert not strip.draw("robot", VIEW, times, [np.zeros(1_000)], inks)
    assert strip.draw("robot", VIEW, times + 0.01, [np.zeros(1_000)], inks)


@given(
    st.lists(st.floats(allow_nan=True, allow_infinity=False, width=32), min_size=0, max_size=300),
    st.integers(1, 90),
    st.integers(1, 90),
)
def test_nothing_that_a_robot_may_send_breaks_it(values: list[float], width: int, height: int) -> None:
    view = View(1.0, -2.0, 2.0, width, height)
    drawn(np.linspace(-1, 0, len(values)), np.array(values, np.float64), view)


@pytest.mark.parametrize("values", [np.zeros(400), np.sin(np.linspace(0, 20, 400)) / 2])
def test_beside_a_thin_line_the_other_is_bold_also_where_it_grows(values: Floats) -> None:
    times, inks = np.linspace(-10, 0, 400), Inks((INK, INK + 1), (False, True))
    below = np.full(400, -0.9)
    whole, grown = Strip(), Strip()
    whole.draw("robot", VIEW, times, [values, below], inks)
    for upto in (250, 251, 320, 400):
        grown.draw("robot", VIEW, times[:upto], [values[:upto], below[:upto]], inks)
    assert (unrolled(whole) == unrolled(grown)).all(), "what was drawn is as bold as what is new"
    alone = drawn(times, values, VIEW) == INK
    bold = unrolled(whole) == INK
    assert (bold | ~alone).all(), "it is where it was"
    assert bold.sum() > 1.5 * alone.sum()
    assert {int(count) for count in (unrolled(whole) == INK + 1).sum(axis=0)} == {1}, "the other is thin"
