"""What the wearer does wrong, as the joints show it."""

from contextlib import closing
from pathlib import Path

import pytest

from hil_sim.without_bus import BareExoskeleton
from tests.unit.hil_sim.outside import Outside

STRIDE_S = 1.8  # more than one


def hip_ranges(outside: Outside) -> list[float]:
    hips = [outside.robot.drives[hip].joint for hip in ("left_hip", "right_hip")]
    angles: list[list[float]] = [[], []]
    for _ in range(round(STRIDE_S * 100)):
        outside.run(0.01)
        for found, hip in zip(angles, hips, strict=True):
            found.append(hip.position)
    return [max(found) - min(found) for found in angles]


def test_gait_asymmetry_makes_one_hip_swing_further_until_it_is_over(tmp_path: Path) -> None:
    with closing(Outside(tmp_path, kind=BareExoskeleton)) as outside:
        asymmetry_comes_and_goes(outside)


def asymmetry_comes_and_goes(outside: Outside) -> None:
    outside.run(1.0)
    outside.faults.begin("gait_asymmetry", params={"percent": 40})
    outside.run(2.0)
    left, right = hip_ranges(outside)
    assert left > 1.25 * right
    outside.faults.clear()
    outside.run(2.0)
    left, right = hip_ranges(outside)
    assert left == pytest.approx(right, rel=0.15)
