"""The window over which left and right are compared: when it is full, and what begins it anew."""

import math

import pytest

from gateway.guard.symmetry import SLICES, Asymmetry, Window

SLICE_S = 0.5
WINDOW_S = SLICES * SLICE_S


def at(seconds: float) -> int:
    return round(seconds * 1e9)


def fill(window: Window, begin_s: float, end_s: float, value: float = 1.0) -> None:
    """Four values a slice, the last one right before the end."""
    for number in range(round((end_s - begin_s) / SLICE_S * 4)):
        window.take(at(begin_s + number * SLICE_S / 4), value)


@pytest.fixture(params=["range", "mean"])
def window(request: pytest.FixtureRequest) -> Window:
    return Window(request.param, WINDOW_S, longest_s=0.2)


def test_it_is_full_after_whole_slices_and_not_before(window: Window) -> None:
    fill(window, 10.25, 10.5 + WINDOW_S)
    assert window.result is None, "the slice in which it began was not seen whole"
    window.take(at(10.5 + WINDOW_S), 99.0)
    assert window.result in (0.0, 1.0)


@pytest.mark.parametrize(("of", "before", "after"), [("range", 4.0, 0.0), ("mean", 1.0 + 4.0 / 64, 1.0)])
def test_it_forgets_what_is_older_than_its_time(of: str, before: float, after: float) -> None:
    window = Window(of, WINDOW_S, longest_s=0.2)
    fill(window, 0.0, SLICE_S)
    window.take(at(SLICE_S), 5.0)
    fill(window, SLICE_S + SLICE_S / 4, SLICE_S + WINDOW_S)
    window.take(at(SLICE_S + WINDOW_S), 1.0)
    assert window.result == pytest.approx(before)
    fill(window, SLICE_S + WINDOW_S + SLICE_S / 4, 2 * SLICE_S + WINDOW_S)
    window.take(at(2 * SLICE_S + WINDOW_S), 1.0)
    assert window.result == after


def test_values_of_one_instant_count_both_and_older_ones_do_not() -> None:
    window = Window("range", WINDOW_S, longest_s=0.2)
    fill(window, 0.0, SLICE_S + WINDOW_S / 2)
    last_s = SLICE_S + WINDOW_S / 2 - SLICE_S / 4
    window.take(at(last_s), 3.0)
    window.take(at(last_s) - 1, 99.0)
    fill(window, last_s + SLICE_S / 4, SLICE_S + WINDOW_S)
    window.take(at(SLICE_S + WINDOW_S), 1.0)
    assert window.result == 2.0


@pytest.mark.parametrize(("gap_ns", "known"), [(200_000_000, True), (200_000_001, False)])
def test_a_gap_that_is_too_long_begins_it_anew(window: Window, gap_ns: int, known: bool) -> None:
    fill(window, 0.0, 3 * SLICE_S + WINDOW_S)
    last_ns = at(3 * SLICE_S + WINDOW_S - SLICE_S / 4)
    window.take(last_ns + gap_ns, 1.0)
    assert (window.result is not None) is known


def test_a_gap_longer_than_the_window_leaves_nothing_to_tell() -> None:
    window = Window("mean", 0.1, longest_s=1.0)
    for hundredth in range(20):
        window.take(at(hundredth / 100), 1.0)
    assert window.result == 1.0
    window.take(at(0.9), 1.0)
    assert window.result is None


def test_a_side_that_begins_anew_makes_the_difference_unknown() -> None:
    both = Asymmetry("mean", 0.16, longest_s=0.05)
    found = None
    for hundredth in range(40):
        both.after(0, at(hundredth / 100), 3.0)
        found = both.after(1, at(hundredth / 100), 1.0)
    assert found is not None
    assert math.isclose(found, 2.0)
    assert both.after(0, at(1.0), 3.0) is None
