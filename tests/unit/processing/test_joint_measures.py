"""Range of motion and tracking error of one joint."""

import math
from collections.abc import Collection
from typing import Any

import numpy as np
import pytest

from server_gui.core.processing.joint_measures import Error, Extremes, tracking_error
from server_gui.core.processing.recording import summarise

ON, OFF, NAN = 4.0, 2.0, math.nan  # states of a drive


def told(error: Error | None) -> tuple[Any, ...]:
    assert error is not None
    return error.rms, error.largest, error.while_enabled


def test_extremes_are_those_since_the_last_end() -> None:
    extremes = Extremes()
    assert extremes.end() is None
    for angle in (0.2, -0.1, 0.5):
        extremes.take(angle)
    assert extremes.end() == pytest.approx(0.6)
    extremes.take(0.4)
    assert extremes.end() == 0.0


def test_a_tracking_error_is_that_of_times_in_which_the_drive_was_enabled() -> None:
    error = np.array([0.9, 0.1, NAN, -0.1, 0.9, 0.9])
    state = np.array([OFF, ON, ON, ON, OFF, NAN])
    found = tracking_error(error, state, {ON})
    assert told(found) == (pytest.approx(0.1), pytest.approx(0.1), True)
    assert tracking_error(error, np.full(6, OFF), {ON}) is None


@pytest.mark.parametrize(
    ("state", "enabled"),
    [([ON, OFF, OFF], None), ([ON, OFF, OFF], ()), ([NAN, NAN, NAN], {ON}), (None, {ON})],
)
def test_an_error_of_a_drive_whose_states_nobody_knows_says_so(
    state: list[float] | None, enabled: Collection[float] | None
) -> None:
    """It said that the drive was never enabled."""
    found = tracking_error(np.array([0.3, NAN, -0.4]), None if state is None else np.array(state), enabled)
    assert told(found) == (pytest.approx(math.sqrt(0.125)), pytest.approx(0.4), False)


def test_the_error_of_a_joint_is_what_its_drive_tells_else_target_minus_position() -> None:
    columns = {
        "elbow.position": np.array([0.1, NAN, 0.1]),
        "elbow.target_position": np.array([0.4, 0.9, 0.9]),
        "elbow.state": np.array([ON, ON, OFF]),
        "knee.position": np.array([0.1, 0.1, 0.1]),
        "knee.target_position": np.array([0.4, 0.9, 0.9]),
        "knee.following_error": np.array([0.02, 0.02, 0.02]),
        "knee.state": np.array([OFF, OFF, OFF]),
        "hip.following_error": np.array([NAN, NAN, NAN]),
    }
    enabled = {"elbow.state": {ON}, "knee.state": {ON}}
    found = summarise(np.arange(3, dtype=np.int64), columns, enabled).errors
    assert told(found["elbow"]) == (pytest.approx(0.3), pytest.approx(0.3), True)
    assert found.keys() == {"elbow", "knee"}
    assert found["knee"] is None
