"""Curves as pixels: in their place, joined, without a spike lost, and not drawn where nothing is known."""

import itertools

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server_gui.views.widgets.raster import DASH, Floats, Pixels, View, draw

INK = 0xFF112233


def drawn(times: Floats, values: Floats, view: View, *, dashed: bool = False) -> Pixels:
    pixels = np.zeros((view.height, view.width), np.uint32)
    draw(pixels, view, times, [values], [(INK, dashed)])
    return pixels


def columns(pixels: Pixels) -> npt.NDArray[np.bool_]:
    """Which columns have something in them."""
    return np.array([column.any() for column in pixels.T], np.bool_)


VIEW = View(-10.0, 0.0, -1.0, 1.0, 200, 101)


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


def test_a_dashed_line_has_gaps() -> None:
    seen = columns(drawn(np.linspace(-10, 0, 500), np.zeros(500), VIEW, dashed=True))
    assert seen[:DASH].all()
    assert not seen[DASH : 2 * DASH].any()


@given(
    st.lists(st.floats(allow_nan=True, allow_infinity=False, width=32), min_size=0, max_size=300),
    st.integers(1, 90),
    st.integers(1, 90),
)
def test_nothing_that_a_robot_may_send_breaks_it(values: list[float], width: int, height: int) -> None:
    view = View(-1.0, 0.0, -2.0, 2.0, width, height)
    drawn(np.linspace(-1, 0, len(values)), np.array(values, np.float64), view)
