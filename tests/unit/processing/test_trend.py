"""What a trend is, and what is none."""

import numpy as np
import pytest

from server_gui.core.processing.trend import rank_sum_p, theil_sen


def test_a_slope_is_in_y_per_x_and_within_its_interval() -> None:
    x = 2.0 * np.arange(60.0)
    found = theil_sen(x, 0.3 * x + np.random.default_rng(1).normal(0.0, 1.0, 60))
    assert found is not None
    assert found.low < 0.3 < found.high
    assert found.high - found.low < 0.03
    assert found.low < found.value < found.high


def test_outliers_do_not_bend_it() -> None:
    x = np.arange(40.0)
    y = 2.0 * x
    y[::8] += 1000.0
    found = theil_sen(x, y)
    assert found is not None
    assert found.value == pytest.approx(2.0)


def test_a_few_points_are_no_trend() -> None:
    assert theil_sen(np.arange(7.0), np.arange(7.0)) is None
    assert theil_sen(np.zeros(20), np.arange(20.0)) is None


def test_two_samples_of_other_sizes_are_told_from_two_of_one() -> None:
    source = np.random.default_rng(1)
    a, b, c = source.normal(0.0, 1.0, 60), source.normal(1.5, 1.0, 60), source.normal(0.0, 1.0, 60)
    assert rank_sum_p(a, b) < 1e-6
    assert rank_sum_p(a, b) == pytest.approx(rank_sum_p(b, a))
    assert rank_sum_p(a, c) > 0.05


def test_nothing_to_compare_is_no_difference() -> None:
    assert rank_sum_p(np.empty(0), np.ones(3)) == 1.0
    assert rank_sum_p(np.ones(5), np.ones(6)) == 1.0
