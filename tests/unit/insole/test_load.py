"""Force and centre of pressure from the cells' pressure."""

import pytest

from drivers.insole import layout as layouts
from drivers.insole.load import Load, Stance, load_of

SQUARE = layouts.Layout(
    name="square", cells=((0.0, -0.1, 0.01), (0.0, 0.1, 0.01), (0.2, -0.1, 0.01), (0.2, 0.1, 0.02))
)


def test_force_is_pressure_times_area_and_cop_its_centre() -> None:
    load = load_of([1000.0, 1000.0, 1000.0, 1000.0], SQUARE, 20.0)
    assert load.force == pytest.approx(50.0)
    assert load.cop_x == pytest.approx(0.2 * 30 / 50)
    assert load.cop_y == pytest.approx(0.1 * 10 / 50)


def test_one_loaded_cell_is_the_centre() -> None:
    assert load_of([0.0, 0.0, 10_000.0, 0.0], SQUARE, 20.0) == pytest.approx((100.0, 0.2, -0.1))


@pytest.mark.parametrize(("pressure", "defined"), [(1999.0, False), (2000.0, True)])
def test_no_centre_of_pressure_below_the_force_threshold(pressure: float, defined: bool) -> None:
    load = load_of([pressure, 0.0, 0.0, 0.0], SQUARE, 20.0)
    assert load.force == pytest.approx(pressure / 100)
    assert (load.cop_x is not None) is defined
    assert (load.cop_y is not None) is defined


def test_unloaded_foot_has_force_zero_and_no_centre() -> None:
    assert load_of([0.0] * 4, SQUARE, 20.0) == Load(0.0, None, None)


def test_missing_cell_makes_the_force_unknown_not_smaller() -> None:
    assert load_of([1000.0, None, 1000.0, 1000.0], SQUARE, 20.0) == Load(None, None, None)
    assert load_of([1000.0], SQUARE, 20.0) == Load(None, None, None)


def test_contact_does_not_flicker_around_the_threshold() -> None:
    stance = Stance(20.0)
    forces = [0.0, 15.0, 25.0, 15.0, 19.0, 9.0, 15.0, None, 20.0]
    assert [stance.contact(force) for force in forces] == [0, 0, 1, 1, 1, 0, 0, None, 1]


@pytest.mark.parametrize(
    ("force", "others", "share"),
    [(300.0, 100.0, 0.75), (0.0, 400.0, 0.0), (5.0, 5.0, None), (None, 400.0, None), (300.0, None, None)],
)
def test_share_of_the_load(force: float | None, others: float | None, share: float | None) -> None:
    assert Stance(20.0).share(force, others) == share
