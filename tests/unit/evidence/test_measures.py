"""A joint's metrics in one stride, against curves whose metrics are known."""

import math

import numpy as np
import pytest

from server_gui.core.evidence.measures import POINTS, jerk, lag, of_joint, overshoot, rms

STRIDE_S = 1.4
AT = np.linspace(0.0, 1.0, POINTS)
SWING = 0.4 * np.sin(math.tau * AT) + 0.1 * np.cos(2 * math.tau * AT)


def later(seconds: float) -> np.ndarray:
    at = AT - seconds / STRIDE_S
    return np.asarray(0.4 * np.sin(math.tau * at) + 0.1 * np.cos(2 * math.tau * at))


@pytest.mark.parametrize("seconds", [0.0, 0.0013, 0.02, 0.11, -0.004])
def test_a_lag_is_found_between_samples(seconds: float) -> None:
    assert lag(SWING, later(seconds), STRIDE_S) == pytest.approx(seconds, abs=2e-4)


def test_overshoot_is_beyond_the_furthest_target_on_either_side() -> None:
    assert overshoot(SWING, SWING * 0.9) == 0.0
    assert overshoot(SWING, SWING * 1.1) == pytest.approx(0.1 * np.abs(SWING).max(), rel=0.01)
    assert overshoot(SWING, np.minimum(SWING, SWING - 0.05 * (SWING < -0.4))) == pytest.approx(0.05)


def test_jerk_is_the_third_derivative() -> None:
    rate = math.tau * 2.0 / STRIDE_S
    velocity = np.sin(math.tau * 2.0 * AT)
    assert jerk(velocity, STRIDE_S) == pytest.approx(rate**2 / math.sqrt(2.0), rel=0.03)


def test_each_metric_has_its_own_curves() -> None:
    curves = {
        "position": SWING,
        "following_error": np.full(POINTS, 0.01),
        "velocity": np.full(POINTS, -2.0),
        "torque": np.full(POINTS, 3.0),
        "current": np.linspace(-4.0, 1.0, POINTS),
        "temperature": np.full(POINTS, 31.5),
    }
    found = of_joint(curves, STRIDE_S)
    assert found["error_rms"] == pytest.approx(0.01)
    assert found["error_peak"] == pytest.approx(0.01)
    assert found["power"] == pytest.approx(6.0)
    assert found["torque_rms"] == pytest.approx(3.0)
    assert found["current_peak"] == pytest.approx(4.0)
    assert found["current_rms"] == pytest.approx(rms(curves["current"]))
    assert found["temperature"] == pytest.approx(31.5)
    assert found["jerk"] == pytest.approx(0.0, abs=1e-6)
    assert {"lag", "overshoot"} <= set(found)


def test_what_a_joint_does_not_tell_is_missing() -> None:
    assert of_joint({}, STRIDE_S) == {}
    assert set(of_joint({"torque": SWING, "position": SWING}, STRIDE_S)) == {"torque_rms"}


def test_a_posture_that_is_held_has_neither_lag_nor_overshoot() -> None:
    noise = 1e-4 * np.random.default_rng(1).normal(size=(2, POINTS))
    found = of_joint({"position": 0.3 + noise[0], "following_error": noise[1]}, STRIDE_S)
    assert set(found) == {"error_rms", "error_peak"}
