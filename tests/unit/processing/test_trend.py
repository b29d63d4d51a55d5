"""Theil–Sen and the rank-sum test against scipy's, which is another's."""

import numpy as np
import pytest
import scipy.stats

from server_gui.core.processing.trend import rank_sum_p, theil_sen


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("ties", [False, True])
def test_slope_and_interval_are_scipys(seed: int, ties: bool) -> None:
    source = np.random.default_rng(seed)
    x = np.arange(60.0)
    y = 0.3 * x + source.normal(0.0, 5.0, 60)
    y = np.round(y) if ties else y
    found, expected = theil_sen(x, y), scipy.stats.theilslopes(y, x, 0.95)
    assert found is not None
    assert found.value == pytest.approx(expected.slope)
    assert found.low == pytest.approx(expected.low_slope, abs=0.01)
    assert found.high == pytest.approx(expected.high_slope, abs=0.01)


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


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("shift", [0.0, 0.7])
def test_p_is_scipys(seed: int, shift: float) -> None:
    source = np.random.default_rng(seed)
    a, b = np.round(source.normal(0.0, 1.0, 30), 1), np.round(source.normal(shift, 1.0, 25), 1)
    expected = scipy.stats.mannwhitneyu(a, b, method="asymptotic").pvalue
    assert rank_sum_p(a, b) == pytest.approx(expected)


def test_nothing_to_compare_is_no_difference() -> None:
    assert rank_sum_p(np.empty(0), np.ones(3)) == 1.0
    assert rank_sum_p(np.ones(5), np.ones(6)) == 1.0
