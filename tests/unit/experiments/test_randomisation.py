"""The test that matches the draw: no drift, whatever its shape, becomes an effect; effects are found."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from server_gui.core.experiments.plan import MOST_PAIRS, USUAL_PAIRS, orders
from server_gui.core.experiments.randomisation import Randomised, randomised

Floats = npt.NDArray[np.float64]
Drift = Callable[[Floats, float], Floats]
DRIFTS: dict[str, Drift] = {
    "none": lambda at, _phase: 0.0 * at,
    "straight": lambda at, _phase: 0.3 * at,
    "bent": lambda at, phase: 0.1 * np.sin(2.0 * np.pi * (at + phase)),
    "a jump": lambda at, phase: np.where(at > phase, 0.2, 0.0),
}


def trial(seed: int, drift: Drift, effect: float = 0.0, metrics: int = 11) -> Randomised:
    """Return what is said of periods whose neighbours resemble each other by 0.5; metric 0 has the effect."""
    source = np.random.default_rng(seed)
    every = orders(USUAL_PAIRS)
    drawn = every[source.integers(len(every))]
    values = np.zeros((2 * USUAL_PAIRS, metrics))
    noise = source.normal(scale=0.02, size=values.shape)
    for place in range(len(values)):
        values[place] = 0.5 * values[max(place - 1, 0)] + noise[place]
    values += drift(np.linspace(0.0, 1.0, len(values)), source.random())[:, None]
    is_second = np.column_stack([drawn < 0, drawn > 0]).ravel()
    values[:, 0] += effect * is_second
    return randomised(values[1::2] - values[::2], drawn, every)


@pytest.mark.parametrize("shape", DRIFTS)
def test_a_drift_of_any_shape_is_no_effect(shape: str) -> None:
    wrong = sum(float(trial(seed, DRIFTS[shape]).p.min()) <= 0.05 for seed in range(120))
    assert wrong <= 13  # of 120 at 5 %: more come by chance once in 200 times


@pytest.mark.parametrize("shape", DRIFTS)
def test_an_effect_is_found_with_its_size(shape: str) -> None:
    told = [trial(seed, DRIFTS[shape], effect=0.15) for seed in range(40)]
    assert sum(float(one.p[0]) <= 0.05 for one in told) >= 38
    assert np.mean([one.difference[0] for one in told]) == pytest.approx(0.15, abs=0.01)
    assert sum(float(one.low[0]) <= 0.15 <= float(one.high[0]) for one in told) >= 34


def test_nothing_that_varies_is_nothing_that_differs() -> None:
    every = orders(8)
    found = randomised(np.zeros((8, 2)), every[3], every)
    assert found.p.tolist() == [1.0, 1.0]
    assert found.low.tolist() == found.high.tolist() == [0.0, 0.0]


def test_each_order_has_its_mirror_image_and_none_is_one_sided() -> None:
    for pairs in range(8, MOST_PAIRS + 1):
        every = {tuple(row) for row in orders(pairs).tolist()}
        assert all(tuple(-sign for sign in row) in every for row in every)
        assert max(abs(sum(row)) for row in every) <= 2
        assert 2 / len(every) <= 0.05 / 3  # the surest that there can be is sure enough, of three families
