"""Counts to SI, and what contradicts the drive."""

import math
from typing import Any

import pytest

from drivers.bus.fields import Linear
from drivers.joint.scaling import contradictions, scalings
from drivers.joint.settings import JointSettings


def settings(**more: Any) -> JointSettings:
    table: dict[str, Any] = {"counts_per_revolution": 4096, "gear_ratio": 100, **more}
    return JointSettings(bus="main", node_id=1, eds="x.eds", **table)


def value(linear: Linear | None, counts: int) -> float:
    assert linear is not None
    return counts * linear.scale + linear.offset


@pytest.mark.parametrize(
    ("more", "quantity", "counts", "expected"),
    [
        ({}, "position", 409_600, math.tau),
        ({"direction": -1, "zero_offset": 0.1}, "position", 102_400, 0.1 - math.pi / 2),
        ({"direction": -1, "zero_offset": 0.1}, "following_error", 102_400, -math.pi / 2),
        ({}, "velocity", 4_096, math.tau / 100),
        ({"velocity_unit": "rpm"}, "velocity", 60, math.tau / 100),
        ({"velocity_unit": "0.001rpm", "direction": -1}, "velocity", 60_000, -math.tau / 100),
        ({"rated_torque": 30}, "torque", 500, 15),
        ({"rated_torque": 30, "direction": -1}, "torque", 500, -15),
        ({"rated_current": 5}, "current", 100, 0.5),
    ],
)
def test_counts_become_si(more: dict[str, Any], quantity: str, counts: int, expected: float) -> None:
    assert value(scalings(settings(**more), {})[quantity], counts) == pytest.approx(expected)


def test_ratings_that_are_not_configured_come_from_the_drive() -> None:
    linears = scalings(settings(), {"rated_torque_mnm": 400, "rated_current_ma": 5000})
    assert value(linears["torque"], 1000) == pytest.approx(40)  # 0.4 N·m at the motor, 1:100
    assert value(linears["current"], 1000) == pytest.approx(5)


@pytest.mark.parametrize("readings", [{}, {"rated_torque_mnm": 0}, {"rated_torque_mnm": None}])
def test_without_any_rating_there_is_no_torque(readings: dict[str, int | None]) -> None:
    assert scalings(settings(), readings)["torque"] is None


@pytest.mark.parametrize(
    ("more", "readings", "words"),
    [
        ({}, {"encoder_increments": 2048, "encoder_revolutions": 1}, "608Fh says 2048"),
        ({}, {"gear_motor_revolutions": 160, "gear_shaft_revolutions": 2}, "6091h says 80"),
        ({"rated_torque": 100}, {"rated_torque_mnm": 400}, "6076h times gear_ratio makes 40"),
        ({"rated_torque": 4}, {"rated_torque_mnm": 400}, "6076h times gear_ratio makes 40"),
        ({"rated_current": 5}, {"rated_current_ma": 3000}, "6075h says 3"),
        ({}, {"velocity_unit": 0xFDB44700}, '60A9h says "0.001rpm"'),
    ],
)
def test_a_contradiction_with_the_drive_is_told(
    more: dict[str, Any], readings: dict[str, int | None], words: str
) -> None:
    (text,) = contradictions(settings(**more), readings)
    assert words in text


@pytest.mark.parametrize(
    ("more", "readings"),
    [
        ({}, {}),
        ({}, {"encoder_increments": 8192, "encoder_revolutions": 2}),
        ({}, {"encoder_increments": 4096, "encoder_revolutions": 0}),
        ({}, {"encoder_increments": 1, "encoder_revolutions": 1}),
        ({}, {"gear_motor_revolutions": 100, "gear_shaft_revolutions": 1}),
        ({}, {"gear_motor_revolutions": 1, "gear_shaft_revolutions": 1}),  # a drive that knows no gear
        ({"rated_torque": 30}, {"rated_torque_mnm": 400}),  # a gear with losses
        ({"velocity_unit": "rpm"}, {"velocity_unit": 0x00B44700}),
    ],
)
def test_what_agrees_is_not_told(more: dict[str, Any], readings: dict[str, int | None]) -> None:
    assert contradictions(settings(**more), readings) == ()
