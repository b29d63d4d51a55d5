"""Units for people: out and back without losing a digit."""

import sys
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.units import UNITS, Unit, Units, percent_body_weight, unit_named, with_minus

ALL = [unit for units in UNITS.values() for unit in units] + [percent_body_weight(81.4)]
values = st.floats(allow_nan=False, allow_infinity=False)


@given(st.sampled_from(ALL), values)
def test_there_and_back_is_the_very_same_value(unit: Unit, value: float) -> None:
    assert unit.si_value(unit.shown(value)) == value


@given(st.sampled_from(ALL), st.floats(-1e12, 1e12))
def test_what_stands_in_an_edit_field_is_the_value_itself(unit: Unit, value: float) -> None:
    assert unit.si_value(unit.editable(value)) == value


@pytest.mark.parametrize("value", [sys.float_info.max, -sys.float_info.max, 5e-324, 0.0])
def test_the_largest_and_the_smallest_can_be_edited(value: float) -> None:
    assert UNITS["m"][0].si_value(UNITS["m"][0].editable(value)) == value


@given(st.sampled_from(ALL), st.decimals(-10000, 10000, allow_nan=False, places=3))
def test_what_was_typed_stands_there_again(unit: Unit, typed: Decimal) -> None:
    assert Decimal(unit.editable(unit.si_value(typed))) == typed


@pytest.mark.parametrize(
    ("quantity", "si", "value", "text"),
    [
        ("position", "rad", 3.141592653589793, "180.0"),
        ("force", "N", 812.4, "812"),
        ("cell_3", "Pa", 73_000.0, "73.0"),
        ("cop_x", "m", 0.1234, "123"),
        ("load_share", "", 0.5, "0.500"),
        ("something", "lx", 2.0, "2.000"),
        ("position", "rad", None, "–"),
    ],
)
def test_usual_units(quantity: str, si: str, value: float | None, text: str) -> None:
    assert Units().unit(quantity, si).text(value) == text


def test_a_quantity_has_its_own_choice() -> None:
    units = Units(by_si={"m": "cm", "N": "% BW"}, by_quantity={"cop_x": "m"}, body_mass=80.0)
    assert units.unit("cop_x", "m").symbol == "m"
    assert units.unit("cop_y", "m").symbol == "cm"
    assert units.unit("force", "N").text(80.0 * 9.80665) == "100.0"


def test_what_cannot_be_is_refused_in_words() -> None:
    with pytest.raises(ValueError, match=r"position in rad cannot be shown in kPa: choose from °, rad"):
        Units(by_si={"rad": "kPa"}).unit("position", "rad")
    with pytest.raises(ValueError, match="cannot be shown in % BW"):
        Units(by_si={"N": "% BW"}).unit("force", "N")
    with pytest.raises(ValueError, match="body mass of 0"):
        percent_body_weight(0)
    for typed in ("", "1,5", "nan", "inf", "12 °", "1e999", "-1e999", "1e-999", "1e9999999999999999999"):
        with pytest.raises(ValueError, match="is not a number in °"):
            UNITS["rad"][0].si_value(typed)


@pytest.mark.parametrize(
    ("symbol", "si", "shown"),
    [
        ("deg", "rad", "°"),
        ("°", "rad", "°"),
        ("rad", "rad", "rad"),
        ("rpm", "rad/s", "rpm"),
        ("Nm", "N·m", "N·m"),
    ],
)
def test_a_unit_is_found_as_people_type_it(symbol: str, si: str, shown: str) -> None:
    assert unit_named(symbol, si).symbol == shown


def test_a_unit_of_something_else_is_refused_with_what_there_is() -> None:
    with pytest.raises(ValueError, match="'N': write it in ° or rad"):
        unit_named("N", "rad")


def test_a_number_beyond_all_floats_is_refused_in_every_unit() -> None:
    for typed in ("1e999999", "-1e999999", "1e-999999", "1e99999999999"):
        for unit in (unit for units in UNITS.values() for unit in units):
            with pytest.raises(ValueError, match="is not a number in"):
                unit.si_value(typed)


@pytest.mark.parametrize(
    ("si", "value", "text"),
    [
        ("rad", 0.052, "2.98"),  # of a device that counts milliradians: 3°
        ("rad", 1.5, "85.9"),
        ("m", 0.42, "420"),
        ("N·m", 30.0, "30"),
        ("N·m", -1234.5678, "-1234.57"),
        ("", 0.01234, "0.0123"),
        ("", 0.0, "0"),
        ("", 2.0**63, "9.22e+18"),
        ("", 1e-12, "1e-12"),
        ("N", 1e300, "1e+300"),
        ("N", float("inf"), "–"),
        ("N", None, "–"),
    ],
)
def test_what_was_set_is_read_in_few_digits(si: str, value: float | None, text: str) -> None:
    assert UNITS[si][0].brief(value) == text


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("-5.7 … -.5", "−5.7 … −.5"),
        ("1e-05", "1e−05"),
        ("2026-11-24T01:13:48Z exo-01", "2026-11-24T01:13:48Z exo-01"),
    ],
)
def test_numbers_have_a_sign_for_minus_and_dates_their_hyphens(written: str, read: str) -> None:
    assert with_minus(written) == read
