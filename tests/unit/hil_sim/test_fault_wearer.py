"""What the wearer does wrong, as the drives' positions show it."""

import math

import pytest

from hil_sim.exoskeleton import JOINTS
from tests.unit.hil_sim.outside import Outside, positions

RAD = math.tau / (4096 * 100)  # per count
STRIDE_S = 1.8  # more than one


def hip_ranges(outside: Outside) -> list[float]:
    messages = outside.run(STRIDE_S)
    found = [positions(messages, JOINTS[hip]) for hip in ("left_hip", "right_hip")]
    return [RAD * (max(counts) - min(counts)) for counts in found]


def test_gait_asymmetry_makes_one_hip_swing_further_until_it_is_over(outside: Outside) -> None:
    outside.run(1.0)
    outside.faults.begin("gait_asymmetry", params={"percent": 40})
    outside.run(2.0)
    left, right = hip_ranges(outside)
    assert left > 1.25 * right
    outside.faults.clear()
    outside.run(2.0)
    left, right = hip_ranges(outside)
    assert left == pytest.approx(right, rel=0.15)
