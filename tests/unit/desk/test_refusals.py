"""Staged edits: what the window says of a value is what the robot, and a file of parameters, say of it."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.parameter_files.comparison import ComparisonVerdict, compare
from gateway.units import Unit
from gateway.wire.parameter import ParameterInfo, ParameterValue
from server_gui.core.tuning.edits import refusal

METRE = Unit("m", "m")
AT_LIMIT = struct.unpack("<f", struct.pack("<f", 0.6))[0]  # what a REAL32 holds of 0.6: a little more


def info(kind: str = "REAL32", max_step: float | None = None) -> ParameterInfo:
    return ParameterInfo(
        name="knee.gain", unit="m", min=-0.7, max=0.6, max_step=max_step, live=True, states=None,
        component="knee", object="0x2000:0", access="rw", store=False, type=kind,
    )  # fmt: skip


def test_what_the_device_holds_at_its_limit_is_within_it() -> None:
    assert AT_LIMIT > 0.6
    assert refusal(AT_LIMIT, 0.5, info(), METRE) is None
    assert refusal(math.nextafter(AT_LIMIT, 1.0), 0.5, info(), METRE) == "above the largest allowed, 0.6 m"


@pytest.mark.parametrize(
    ("value", "says"),
    [
        (-0.8, "below the smallest allowed, -0.7 m"),
        (0.7, "above the largest allowed, 0.6 m"),
        (0.25, "further than one write may go, 0.1 m: take two steps"),
        (0.1, None),
    ],
)
def test_the_limit_is_told_in_the_unit_shown(value: float, says: str | None) -> None:
    assert refusal(value, 0.0, info(max_step=0.1), METRE) == says


def test_a_robot_that_tells_no_types_has_its_limits_as_they_are() -> None:
    assert refusal(0.6, 0.0, info(kind=""), METRE) is None
    assert refusal(AT_LIMIT, 0.0, info(kind=""), METRE) is not None


def test_a_parameter_that_has_gone_is_told() -> None:
    assert refusal(0.1, 0.0, None, METRE) == "the robot has no such parameter any more"


@given(
    value=st.floats(-1.0, 1.0, width=32),
    held=st.floats(-0.5, 0.5, width=32),
    max_step=st.none() | st.floats(0.01, 1.0),
)
def test_window_and_file_agree(value: float, held: float, max_step: float | None) -> None:
    parameter = info(max_step=max_step)
    now = ParameterValue(held, "m", -0.7, 0.6, 0)
    (row,) = compare({"knee.gain": value}, {"knee.gain": parameter}, {"knee.gain": now})
    refused = row.verdict in (ComparisonVerdict.OUT_OF_LIMITS, ComparisonVerdict.TOO_FAR)
    assert refused == (refusal(value, held, parameter, METRE) is not None)


def test_a_file_can_say_nothing_of_a_parameter_without_a_type() -> None:
    now = ParameterValue(0.1, "m", -0.7, 0.6, 0)
    (row,) = compare({"knee.gain": 0.2}, {"knee.gain": info(kind="")}, {"knee.gain": now})
    assert (row.verdict, row.why) == (ComparisonVerdict.UNREADABLE, "its type is not known")
