"""Range of motion and tracking error of one joint."""

import math

import pytest

from server_gui.core.processing.joint_measures import Extremes, TrackingError


def test_extremes_are_those_since_the_last_end() -> None:
    extremes = Extremes()
    assert extremes.end() is None
    for angle in (0.2, -0.1, 0.5):
        extremes.take(angle)
    assert extremes.end() == pytest.approx(0.6)
    extremes.take(0.4)
    assert extremes.end() == 0.0


def test_error_is_over_the_last_two_seconds() -> None:
    error = TrackingError()
    for step in range(1000):
        error.take(step * 10_000_000, 0.5 if step < 500 else 0.1 * math.sin(step))
    found = error.at(9_990_000_000)
    assert found is not None
    assert found.rms == pytest.approx(0.1 / math.sqrt(2), rel=0.02)
    assert found.largest == pytest.approx(0.1, rel=0.01)


def test_an_error_that_is_not_told_any_more_is_gone() -> None:
    error = TrackingError()
    error.take(0, 0.1)
    assert error.at(100_000_000) is not None
    assert error.at(5_000_000_000) is None
    assert TrackingError().at(0) is None
