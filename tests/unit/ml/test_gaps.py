"""Samples that never came: what a window holds there."""

import numpy as np

from ml.features.gaps import mended

NO = np.nan


def test_a_gap_that_is_over_is_crossed_in_a_straight_line() -> None:
    assert mended(np.array([[1.0, NO, NO, 4.0, 4.0]])).tolist() == [[1.0, 2.0, 3.0, 4.0, 4.0]]


def test_a_gap_that_lasts_holds_the_value_before_it_and_one_at_the_beginning_the_value_after() -> None:
    assert mended(np.array([[NO, NO, 2.0, 3.0, NO]])).tolist() == [[2.0, 2.0, 2.0, 3.0, 3.0]]


def test_a_window_without_gaps_is_itself() -> None:
    whole = np.random.default_rng(0).normal(size=(3, 2, 9))
    assert mended(whole) is whole


def test_channels_and_windows_do_not_mix_and_a_channel_of_nothing_stays_unknown() -> None:
    windows = np.arange(24.0).reshape(2, 2, 6)
    windows[0, 1] = NO
    windows[1, 0, 2:4] = NO
    found = mended(windows)
    assert np.isnan(found[0, 1]).all()
    assert np.array_equal(found[1], np.arange(12.0, 24.0).reshape(2, 6))
    assert np.array_equal(found[0, 0], windows[0, 0])
