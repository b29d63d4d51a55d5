"""Expressions: units are checked, what is missing is missing, and no text does more than raise its error."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server_gui.core.workspace.dimensions import Dimension, literal
from server_gui.core.workspace.expressions import Block, Floats, Program
from server_gui.core.workspace.grammar import DEEPEST, LONGEST, ExpressionError, parse
from tests.support.examples import examples

UNITS = {
    "left_knee.position": "rad",
    "left_knee.target": "rad",
    "left_knee.velocity": "rad/s",
    "left_knee.torque": "N·m",
    "left-insole.force": "N",
}
RATE_HZ = 100


def program(text: str) -> Program:
    return Program(parse(text), text, UNITS)


def computed(text: str, **columns: list[float]) -> list[float]:
    """Of the knee, a row each 10 ms; what is not given is 1."""
    rows = max(map(len, columns.values()))
    found = {name: np.ones(rows) for name in UNITS}
    found |= {f"left_knee.{name}": np.array(values) for name, values in columns.items()}
    values = program(text).take(Block(np.arange(rows) / RATE_HZ, found))
    return [float(value) for value in values]


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("left_knee.position - left_knee.target", "rad"),
        ("left_knee.position-left_knee.target", "rad"),
        ("left-insole.force/2", "N"),
        ("error = abs(left_knee.position - 5 [°])", "rad"),
        ("left_knee.torque * left_knee.velocity", "W"),
        ("left_knee.torque * left_knee.velocity / 5 [V]", "A"),
        ("diff(left_knee.torque)", "N·m/s"),
        ("diff(left_knee.position)", "rad/s"),
        ("diff(diff(left_knee.position))", "rad/s²"),
        ("deg(left_knee.position) + 1", ""),
        ("max(left_knee.torque, -3 [Nm], 0 [N·m])", "N·m"),
        ("sqrt(left_knee.torque * left_knee.torque)", "N·m"),
        ("rms(left_knee.torque, 0.5 [s])", "N·m"),
        ("lowpass(left_knee.torque, 5 [Hz])", "N·m"),
        ("sin(left_knee.position)", ""),
        ("left_knee.torque / left_knee.position", "N·m/rad"),
    ],
)
def test_an_expression_has_a_unit(text: str, unit: str) -> None:
    assert program(text).unit == unit


@pytest.mark.parametrize(
    ("text", "marked", "problem"),
    [
        ("left_knee.position + left_knee.torque", "+", "rad and N·m cannot be added"),
        ("left_knee.position - 5", "-", "give the number a unit"),
        ("max(left_knee.position, left_knee.torque)", "max", "cannot be compared"),
        ("sin(left_knee.torque)", "sin", "is of rad, not of N·m"),
        ("deg(1)", "deg", "is of rad, not of no unit"),
        ("sqrt(left_knee.torque)", "sqrt", "no square root"),
        ("power(left_knee.torque)", "power", "there is no function power"),
        ("abs(left_knee.torque, 1)", "abs", "takes 1 argument, not 2"),
        ("rms(left_knee.torque, left_knee.position)", "left_knee.position", "is a number in s"),
        ("rms(left_knee.torque, 0)", "0", "above 0"),
        ("rms(left_knee.torque, 1e9)", "1e9", "at most 60 s"),
        ("lowpass(left_knee.torque, 5 [s])", "5", "it is in Hz, not in s"),
        ("5 [furlong]", "5", "nobody here knows the unit"),
        ("left_knee.position left_knee.target", "left_knee.target", "not expected here"),
        ("left_knee", "left_knee", "is no channel"),
        ("__import__('os').system", "'", "means nothing here"),
        ("().__class__", ".", "means nothing here"),
        ("(left_knee.position", "", "is not closed"),
        ("= left_knee.position", "=", "a name is missing"),
        ("", "", "is missing here"),
        ("1e999", "1e999", "too large"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(text: str, marked: str, problem: str) -> None:
    with pytest.raises(ExpressionError) as found:
        program(text)
    error = found.value
    assert problem in error.problem
    assert text[error.place : error.place + error.length] == marked
    said = str(error).splitlines()
    assert said[1].index("^") == error.place, "the place is not below what it means"


@pytest.mark.parametrize(
    "text", ["(" * 300 + "1" + ")" * 99, "-" * (LONGEST - 1) + "1", "1+" * 150 + "1", "1" * 500]
)
def test_an_expression_has_bounds(text: str) -> None:
    assert len(text) > DEEPEST
    with pytest.raises(ExpressionError, match=r"more than|longer than"):
        parse(text)


def test_signs_bind_as_everywhere() -> None:
    assert computed("2 + 3 * 4 - 6 / 2 / 3", position=[0.0]) == [13.0]
    assert computed("-(2 - 3) * -2", position=[0.0]) == [-2.0]


def test_what_is_missing_makes_missing_and_no_number_is_made_up() -> None:
    nan = math.nan
    error = computed(
        "left_knee.position - left_knee.target", position=[1.0, nan, 3.0], target=[0.5, 0.5, nan]
    )
    assert error[0] == 0.5
    assert np.isnan(error[1:]).all()
    assert np.isnan(computed("min(left_knee.position, left_knee.target)", position=[nan], target=[1.0])).all()
    assert np.isnan(computed("left_knee.torque / left_knee.position", position=[0.0])).all(), "infinite"
    slope = computed("diff(left_knee.position)", position=[0.0, 0.1, nan, 0.3, 0.4])
    assert slope[1] == pytest.approx(10.0)
    assert [math.isnan(value) for value in slope] == [True, False, True, True, False]


def test_a_window_is_missing_until_it_is_full_and_after_a_gap() -> None:
    values = [3.0] * 12
    values[6] = math.nan
    found = computed("rms(left_knee.position, 0.03)", position=values)
    assert [math.isnan(value) for value in found] == [True] * 3 + [False] * 3 + [True] * 4 + [False] * 2
    assert found[-1] == pytest.approx(3.0)


@pytest.mark.parametrize("spike", [1e17, 1e200, math.inf])
@pytest.mark.parametrize("text", ["mean(left_knee.position, 0.03)", "rms(left_knee.position, 0.03)"])
def test_a_spike_that_has_left_the_window_leaves_nothing_behind(text: str, spike: float) -> None:
    """Sums that go on would lose the small in the large: 0 was drawn where 1 was."""
    values = [1.0] * 20
    values[5] = spike
    found = computed(text, position=values)
    assert found[9:] == pytest.approx([1.0] * 11)


def test_values_whose_sum_is_no_float_any_more_spoil_only_their_window() -> None:
    found = computed("mean(left_knee.position, 0.03)", position=[1.0] * 4 + [1e308] * 2 + [1.0] * 8)
    assert found[9:] == pytest.approx([1.0] * 5)


def test_a_long_window_costs_no_more_a_row_than_a_short_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """24 means over a minute at 1 kHz took two frames' time each frame."""
    written = parse("mean(a.x, 60)")
    program = Program(written, "mean(a.x, 60)", {"a.x": "rad"})
    times, sizes, add_up = np.arange(62_000) / 1000, [], np.cumsum

    def counted(values: Floats) -> Floats:
        sizes.append(len(values))
        return np.asarray(add_up(values))

    program.take(Block(times[:61_000], {"a.x": times[:61_000]}))
    monkeypatch.setattr(np, "cumsum", counted)
    for begin in range(61_000, 62_000, 50):
        program.take(Block(times[begin : begin + 50], {"a.x": times[begin : begin + 50]}))
    assert sum(sizes) < 10_000


def test_a_lowpass_reaches_63_percent_after_its_time_constant() -> None:
    cutoff_hz = 1 / (2 * math.pi * 0.1)
    found = computed(f"lowpass(left_knee.position, {cutoff_hz})", position=[0.0] + [1.0] * 40)
    assert found[10] == pytest.approx(1 - math.exp(-1))


TEXTS = (
    "left_knee.position - left_knee.target",
    "lowpass(left_knee.position, 3) + left_knee.target",
    "rms(diff(left_knee.position), 0.05)",
    "mean(abs(left_knee.position), 0.1)",
)


@given(
    values=st.lists(st.one_of(st.just(math.nan), st.floats(-10, 10)), min_size=1, max_size=60),
    cuts=st.lists(st.integers(0, 60), max_size=5),
    text=st.sampled_from(TEXTS),
)
@settings(max_examples=examples(60), deadline=None)
def test_rows_that_come_piece_by_piece_are_computed_as_all_at_once(
    values: list[float], cuts: list[int], text: str
) -> None:
    times = np.arange(len(values)) / RATE_HZ
    columns = {name: np.array(values) for name in UNITS}
    whole = program(text).take(Block(times, columns))
    pieces, running = [], program(text)
    ends = sorted({min(cut, len(values)) for cut in cuts} | {0, len(values)})
    for begin, end in itertools.pairwise(ends):
        part: dict[str, Floats] = {name: column[begin:end] for name, column in columns.items()}
        pieces.append(running.take(Block(times[begin:end], part)))
    np.testing.assert_allclose(np.concatenate(pieces), whole, rtol=1e-6, atol=1e-6)


@given(st.one_of(st.text(max_size=60), st.text("()+-*/,.[]= 1eabs_left_knee.positionrms", max_size=80)))
@settings(max_examples=examples(300), deadline=None)
def test_no_text_does_anything_but_mean_something_or_raise_its_error(text: str) -> None:
    try:
        written = parse(text)
        Program(written, text, dict.fromkeys(written.channels, "rad"))
    except ExpressionError as error:
        told = error
    else:
        return
    assert 0 <= told.place <= len(text)
    assert told.line


@given(st.sampled_from(sorted(set(UNITS.values()))), st.sampled_from(sorted(set(UNITS.values()))))
def test_a_product_divided_by_its_factor_is_the_other_factor(one: str, other: str) -> None:
    first, second = Dimension.of(one), Dimension.of(other)
    assert first.times(second).times(first, -1) == second
    assert first.times(second) == second.times(first)
    assert Dimension.of(first.symbol) == first


def test_units_are_taken_as_people_write_them() -> None:
    found = literal("deg")
    assert found is not None
    assert found[0] == pytest.approx(math.pi / 180)
    assert found[1] == Dimension.of("rad")
    assert literal("°C") == (1.0, Dimension.of("°C"))
    assert literal("parsec") is None
    assert literal("") == (1.0, Dimension())
