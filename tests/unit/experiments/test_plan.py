"""What may be planned: within the object's limits, never in jumps, and the same order with the same seed."""

import itertools

import pytest

from gateway.units import Unit
from gateway.wire.parameter import ParameterInfo
from server_gui.core.experiments.plan import BadPlan, Dwell, ExperimentPlan, ab, signs, sweep

METRE = Unit("m", "m")
STEP_LENGTH = ParameterInfo(
    "gait.step_length",
    "m",
    0.2,
    0.6,
    0.1,
    True,
    None,
    "gait",
    "0x2001:0",
    "rw",
    True,
    type="INTEGER32",
    scale=0.001,
)


def values(plan: ExperimentPlan) -> list[float]:
    """In the order in which they are held."""
    return [step.value for step in plan.steps]


def test_pairs_have_both_values_and_their_order_is_drawn_with_a_seed() -> None:
    plan = ab(STEP_LENGTH, 0.4, (0.4, 0.45), METRE, pairs=8, seed=3)
    assert values(plan) == values(ab(STEP_LENGTH, 0.4, (0.4, 0.45), METRE, pairs=8, seed=3))
    held = values(plan)
    assert all({*pair} == {0.4, 0.45} for pair in zip(held[::2], held[1::2], strict=True))
    assert abs(int(signs(plan).sum())) <= 2
    drawn = {
        tuple(values(ab(STEP_LENGTH, 0.4, (0.4, 0.45), METRE, pairs=8, seed=seed))) for seed in range(20)
    }
    assert len(drawn) > 10
    assert ab(STEP_LENGTH, 0.4, (0.4, 0.45), METRE).seed is not None


def test_a_sweep_goes_to_its_beginning_and_then_upwards_never_in_jumps() -> None:
    plan = sweep(STEP_LENGTH, 0.4, (0.3, 0.5, 0.04), METRE)
    assert plan.values == pytest.approx((0.3, 0.34, 0.38, 0.42, 0.46, 0.5))
    assert [step.is_measured for step in plan.steps] == [False, False] + [True] * 6
    way = [0.4, *values(plan)]
    assert max(abs(later - earlier) for earlier, later in itertools.pairwise(way)) <= 0.04 + 1e-9


@pytest.mark.parametrize(
    ("second", "why"),
    [
        (0.7, "largest allowed"),
        (0.55, "take two steps"),
        (0.4001, "the same to the device"),
        (0.1, "smallest"),
    ],
)
def test_what_the_robot_would_refuse_is_not_planned(second: float, why: str) -> None:
    with pytest.raises(BadPlan, match=why):
        ab(STEP_LENGTH, 0.4, (0.4, second), METRE)


@pytest.mark.parametrize(
    ("span", "why"),
    [
        ((0.5, 0.3, 0.05), "upwards"),
        ((0.3, 0.5, -0.05), "upwards"),
        ((0.3, float("nan"), 0.05), "upwards"),
        ((0.3, 0.5, 0.001), "larger STEP"),
        ((0.4, 0.4004, 0.0002), "tell such values apart"),
        ((0.3, 0.7, 0.05), "largest allowed|take two steps"),
        ((0.2, 0.6, 0.05), "take two steps"),  # its way back would be too far for one write
    ],
)
def test_a_sweep_that_cannot_be(span: tuple[float, float, float], why: str) -> None:
    with pytest.raises(BadPlan, match=why):
        sweep(STEP_LENGTH, 0.4, span, METRE)


def test_too_few_pairs_to_tell_anything_and_no_time_at_all() -> None:
    with pytest.raises(BadPlan, match="7 pairs"):
        ab(STEP_LENGTH, 0.4, (0.4, 0.45), METRE, pairs=7)
    with pytest.raises(BadPlan, match="gait cycles"):
        ab(STEP_LENGTH, 0.4, (0.4, 0.45), METRE, dwell=Dwell(cycles=1))


def test_a_trial_outlasts_what_it_is_held_for() -> None:
    for dwell in (Dwell(), Dwell(60, 20), Dwell(seconds=240.0)):
        assert dwell.limit_s < dwell.trial_s <= 300.0
