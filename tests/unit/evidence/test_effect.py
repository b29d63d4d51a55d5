"""A step is found beside drift and correlation, and its error is neither too small nor left to chance."""

import numpy as np
import pytest

from server_gui.core.evidence.effect import Floats, block_lengths, bootstrap_variance, effects, holm

CYCLES, COLUMNS = 60, 600
AFTER = np.arange(CYCLES) >= CYCLES // 2
TREND = np.column_stack([np.ones(CYCLES), np.linspace(-1.0, 1.0, CYCLES)])


def noise(correlation: float, seed: int = 1, cycles: int = CYCLES, columns: int = COLUMNS) -> Floats:
    """Columns in which each cycle keeps so much of the one before."""
    source = np.random.default_rng(seed)
    fresh = source.normal(size=(cycles, columns)) * np.sqrt(1.0 - correlation**2)
    values = np.empty_like(fresh)
    values[0] = source.normal(size=columns)
    for place in range(1, cycles):
        values[place] = correlation * values[place - 1] + fresh[place]
    return np.asarray(values)


@pytest.mark.parametrize("correlation", [0.0, 0.4, 0.6])
def test_what_nothing_has_changed_is_rarely_sure(correlation: float) -> None:
    p = effects(noise(correlation), AFTER.astype(float), TREND, AFTER).p
    assert np.mean(p < 0.05) <= 0.08
    assert np.mean(p < 0.01) <= 0.025


def test_an_interval_holds_what_was_changed() -> None:
    found = effects(noise(0.4) + 3.0 * AFTER[:, None], AFTER.astype(float), TREND, AFTER)
    holds = np.abs(found.difference - 3.0) <= found.half_width
    assert np.mean(holds) >= 0.92
    assert np.median(found.size) == pytest.approx(3.0, rel=0.2)


def test_a_drift_is_no_effect_and_hides_none() -> None:
    drift = np.linspace(0.0, 10.0, CYCLES)[:, None]
    p = effects(noise(0.3) + drift, AFTER.astype(float), TREND, AFTER).p
    assert np.mean(p < 0.05) <= 0.08
    found = effects(noise(0.3) + drift - 3.0 * AFTER[:, None], AFTER.astype(float), TREND, AFTER)
    assert np.mean(found.difference) == pytest.approx(-3.0, abs=0.1)


@pytest.mark.parametrize("length", [1, 3, 7])
def test_the_variance_is_that_of_endlessly_many_draws(length: int) -> None:
    source = np.random.default_rng(2)
    residuals, weights = source.normal(size=(24, 1)), source.normal(size=24)
    pieces = -(-24 // length)
    starts = source.integers(0, 24, size=(40_000, pieces))
    drawn = ((starts[:, :, None] + np.arange(length)) % 24).reshape(len(starts), -1)[:, :24]
    centred = residuals[:, 0] - residuals.mean()
    sums = centred[drawn] @ weights
    exact = bootstrap_variance(residuals, weights, length) * (24 - length) / 24
    assert exact[0] == pytest.approx(sums.var(), rel=0.03)


def test_blocks_are_as_long_as_cycles_resemble_each_other() -> None:
    loose, close = (float(np.median(block_lengths(noise(one), AFTER))) for one in (0.0, 0.7))
    assert loose <= 3.0 < close


def test_a_number_that_never_varies_but_jumps_is_sure() -> None:
    found = effects(AFTER[:, None] * 2.0 + np.zeros((CYCLES, 1)), AFTER.astype(float), TREND, AFTER)
    assert found.difference[0] == pytest.approx(2.0)
    assert found.p[0] < 1e-6


def test_many_looks_cost_each_its_share() -> None:
    assert holm(np.array([0.01, 0.04, 0.03])) == pytest.approx([0.03, 0.06, 0.06])
    assert holm(np.array([0.9, 0.6])) == pytest.approx([1.0, 1.0])
    assert len(holm(np.array([]))) == 0


@pytest.mark.parametrize(
    ("before", "after", "correlation"),
    [(20, 20, 0.7), (9, 90, 0.4), (90, 9, 0.4)],
)
def test_few_or_long_alike_cycles_do_not_look_surer_than_they_are(
    before: int, after: int, correlation: float
) -> None:
    """At what one of sixty metrics must keep, so that together they err in few of hundred edits."""
    wrong = 0
    for seed in range(20):
        values = noise(correlation, seed, before + after, 60)
        behind = np.arange(before + after) >= before
        trend = np.column_stack([np.ones(before + after), np.linspace(-1.0, 1.0, before + after)])
        found = effects(values, behind.astype(float), trend, behind)
        wrong += int(np.sum(found.p < 0.01 / 60))
    assert wrong <= 2
