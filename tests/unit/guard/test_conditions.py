"""Bands with hysteresis, and I²t against its closed form."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.guard.conditions import Band, Heat

BAND = Band(-1.0, 2.0, 0.25)


@pytest.mark.parametrize(
    ("value", "left", "still_left"),
    [
        (0.0, False, False),
        (2.0, False, True),
        (2.0001, True, True),
        (1.75, False, False),
        (1.7501, False, True),
        (-1.0, False, True),
        (-1.0001, True, True),
        (-0.75, False, False),
        (-0.7501, False, True),
        (math.inf, True, True),
        (-math.inf, True, True),
        (math.nan, True, True),
    ],
)
def test_a_band_has_its_ends_in_it_and_is_reached_again_only_inside_of_its_hysteresis(
    value: float, left: bool, still_left: bool
) -> None:
    assert BAND.left(value, tripped=False) is left
    assert BAND.left(value, tripped=True) is still_left


def closed_form(load: float, at_s: float, time_constant_s: float) -> float:
    """heat' = (load² − heat) / τ from heat 0."""
    return load**2 * (1 - math.exp(-at_s / time_constant_s))


@given(
    load=st.floats(0.1, 5.0),
    time_constant_s=st.floats(0.5, 100.0),
    steps=st.lists(st.integers(1, 400_000_000), min_size=1, max_size=50),
)
def test_heat_is_the_closed_form_however_it_is_sampled(
    load: float, time_constant_s: float, steps: list[int]
) -> None:
    heat = Heat(rated=3.0, time_constant_s=time_constant_s, longest_s=0.5)
    stamp_ns = 7
    heat.after(stamp_ns, 3.0 * load)
    for step_ns in steps:
        stamp_ns += step_ns
        heat.after(stamp_ns, 3.0 * load)
    assert heat.heat == pytest.approx(closed_form(load, (stamp_ns - 7) / 1e9, time_constant_s), rel=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_heat_reaches_its_limit_when_the_closed_form_does(sign: int) -> None:
    """Twice the rated current for τ·ln(4/3): the mean of the square reaches 1."""
    heat, period_ns, stamp_ns = Heat(rated=5.0, time_constant_s=10.0, longest_s=0.5), 10_000_000, 0
    while heat.after(stamp_ns, sign * 10.0) <= 1.0:
        stamp_ns += period_ns
    assert stamp_ns / 1e9 == pytest.approx(10.0 * math.log(4 / 3), abs=0.02)


def test_heat_goes_as_it_came() -> None:
    heat = Heat(rated=1.0, time_constant_s=0.2, longest_s=1.0)
    heat.after(0, 3.0)
    hot = heat.after(200_000_000, 0.0)
    assert hot == pytest.approx(9 * (1 - math.exp(-1)))
    assert heat.after(400_000_000, 0.0) == pytest.approx(hot * math.exp(-1))


def test_time_without_values_neither_heats_nor_cools() -> None:
    seen, gap = (Heat(rated=1.0, time_constant_s=2.0, longest_s=0.5) for _ in range(2))
    for heat in (seen, gap):
        heat.after(0, 2.0)
    assert gap.after(3_600_000_000_000, 0.0) == seen.after(500_000_000, 0.0)


def test_a_late_value_takes_nothing_away() -> None:
    heat = Heat(rated=1.0, time_constant_s=2.0, longest_s=0.5)
    heat.after(0, 2.0)
    hot = heat.after(400_000_000, 2.0)
    assert heat.after(300_000_000, 2.0) == hot
