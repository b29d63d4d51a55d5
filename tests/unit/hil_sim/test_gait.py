"""The gaits' joint angles, against measured curves."""

import csv
import math
import statistics
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import pytest

from hil_sim.gait.activity import Activity
from hil_sim.gait.curves import Leg, measured
from hil_sim.gait.gaits import GAITS
from hil_sim.gait.subject import NOMINAL_LEG_LENGTH
from hil_sim.gait.walk import PELVIC_TILT, Shape, hip_range, level, lifted, stance_share, swing
from tests.unit.hil_sim.moving import stride_of

DATA = Path(__file__).parents[2] / "data"
PHASES = [index / 200 for index in range(200)]
JOINTS = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
SPEEDS = range(5)


def rms(a: Sequence[float], b: Sequence[float]) -> float:
    return math.sqrt(statistics.fmean((x - y) ** 2 for x, y in zip(a, b, strict=True)))


def test_the_measured_curves_are_those_of_the_table() -> None:
    slowest, *_, fastest = measured()
    assert math.degrees(slowest.hip(0.0)) == pytest.approx(30.195, abs=0.1)
    assert math.degrees(slowest.hip(0.56)) == pytest.approx(1.506, abs=0.2)
    assert math.degrees(fastest.knee(0.72)) == pytest.approx(61.879, abs=0.7)


@pytest.mark.parametrize("speed", SPEEDS)
def test_with_the_measured_hips_step_length_the_legs_are_the_measured_ones(speed: int) -> None:
    curves = measured()[speed]
    step_length = 2.0 * NOMINAL_LEG_LENGTH * math.sin(curves.hip.range / 2.0)
    legs = [level(phase, step_length) for phase in PHASES]
    assert rms([leg.hip for leg in legs], [curves.hip(p) - PELVIC_TILT for p in PHASES]) < math.radians(0.1)
    assert rms([leg.knee for leg in legs], [curves.knee(p) for p in PHASES]) < math.radians(0.1)
    assert rms([leg.ankle for leg in legs], [curves.ankle(p) for p in PHASES]) < math.radians(0.1)


def test_level_walking_is_that_of_adults_who_were_never_part_of_the_table() -> None:
    """A step of 0.6 m: within one standard deviation between the adults, and the same shape."""
    with (DATA / "adult_joint_angles.csv").open(encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    legs = [level(float(row["gait_cycle_pct"]) / 100.0 % 1.0, 0.6) for row in rows]
    tilt = (math.degrees(PELVIC_TILT), 0.0, 0.0)
    for joint, name in enumerate(JOINTS):
        theirs = [float(row[f"{name}_deg"]) - tilt[joint] for row in rows]
        ours = [math.degrees(leg[joint]) for leg in legs]
        spread = statistics.fmean(float(row[f"{name}_sd_deg"]) for row in rows)
        assert rms(ours, theirs) < spread
        assert statistics.correlation(ours, theirs) > 0.98


@pytest.mark.parametrize("name", ["WALK", "STAIRS_UP", "STAIRS_DOWN", "RAMP_UP"])
def test_the_hips_move_as_on_a_real_exoskeleton(name: str) -> None:
    """Their middle near the measured one, nothing beyond what was measured, in angle and velocity."""
    with (DATA / "exoskeleton_hips.csv").open(encoding="ascii") as file:
        row = next(row for row in csv.DictReader(file) if row["activity"] == name.lower())
    real = {column: float(value) for column, value in row.items() if column != "activity"}
    moments = stride_of(Activity[name], Shape(0.55, 1.3, 0.06, 0.05))
    hips = [moment.legs[0].hip for moment in moments]
    speeds = [(b - a) / 0.01 for a, b in pairwise(hips)]
    assert abs(statistics.median(hips) - real["hip_p50_rad"]) < 0.25
    assert real["hip_p01_rad"] - 0.1 < min(hips) < real["hip_p25_rad"]
    assert real["hip_p50_rad"] < max(hips) < real["hip_p99_rad"] + 0.1
    assert real["hip_velocity_p01_rad_s"] < min(speeds) < -0.8
    assert 1.5 < max(speeds) < real["hip_velocity_p99_rad_s"]


# Peaks in degrees and where in the stride they lie, as stairs of about 30° have them (Riener et al. 2002).
STAIR_PEAKS = [
    (Activity.STAIRS_UP, "knee", 85.0, 100.0, 0.75, 0.85),
    (Activity.STAIRS_UP, "hip", 50.0, 70.0, 0.80, 0.95),
    (Activity.STAIRS_DOWN, "knee", 80.0, 95.0, 0.65, 0.75),
    (Activity.STAIRS_DOWN, "ankle", 25.0, 40.0, 0.45, 0.60),
]


@pytest.mark.parametrize(("gait", "joint", "low", "high", "early", "late"), STAIR_PEAKS)
def test_peaks_on_stairs(
    gait: Activity, joint: str, low: float, high: float, early: float, late: float
) -> None:
    angles = [math.degrees(getattr(GAITS[gait].leg(p, 0.4, NOMINAL_LEG_LENGTH), joint)) for p in PHASES]
    assert low < max(angles) < high
    assert early < PHASES[angles.index(max(angles))] < late


def test_a_foot_comes_down_on_stairs_toes_first() -> None:
    down = GAITS[Activity.STAIRS_DOWN]
    assert down.leg(0.0, 0.4, NOMINAL_LEG_LENGTH).ankle < math.radians(-15.0)
    assert down.path.at(0.0) > 0.15 > down.path.at(0.4)


def test_a_ramp_bends_the_leg_that_meets_it_further() -> None:
    flat, up, down = (
        GAITS[gait].leg(0.0, 0.4, NOMINAL_LEG_LENGTH)
        for gait in (Activity.WALK, Activity.RAMP_UP, Activity.RAMP_DOWN)
    )
    assert up.hip - flat.hip > math.radians(10.0)
    assert up.knee - flat.knee > math.radians(10.0)
    assert down.hip < flat.hip


@pytest.mark.parametrize("gait", GAITS)
def test_curves_are_periodic_and_smooth(gait: Activity) -> None:
    legs = [GAITS[gait].leg(index / 1000 % 1.0, 0.4, NOMINAL_LEG_LENGTH) for index in range(1001)]
    assert legs[-1] == legs[0]
    for joint in range(3):
        assert max(abs(b[joint] - a[joint]) for a, b in pairwise(legs)) < 0.012


@pytest.mark.parametrize("step_length", [0.3, 0.4, 0.6])
def test_the_thigh_trails_behind_the_trunk_in_late_stance(step_length: float) -> None:
    hips = [math.degrees(level(phase, step_length).hip) for phase in PHASES]
    trailing = min(hips)
    assert -25.0 < trailing < -3.0
    assert 0.4 < PHASES[hips.index(trailing)] < 0.62


@pytest.mark.parametrize("step_length", [0.2, 0.3, 0.4, 0.5, 0.6])
@pytest.mark.parametrize("leg_length", [0.72, 0.8, 0.98])
def test_the_hips_range_is_what_the_step_length_needs(step_length: float, leg_length: float) -> None:
    hips = [level(phase, step_length, leg_length).hip for phase in PHASES]
    assert max(hips) - min(hips) == pytest.approx(hip_range(step_length, leg_length), rel=0.03)


def test_toe_height_bends_knee_and_ankle_in_swing_and_leaves_stance() -> None:
    def leg(phase: float, toe_height: float) -> Leg:
        return lifted(level(phase, 0.4), toe_height, swing(phase, 0.62))

    low, high = leg(0.81, 0.02), leg(0.81, 0.12)
    assert high.knee - low.knee > 0.2
    assert high.ankle - low.ankle > 0.1
    assert leg(0.31, 0.02) == leg(0.31, 0.12)


def test_double_support_shrinks_with_speed() -> None:
    double = [2.0 * stance_share(speed) - 1.0 for speed in (0.3, 0.7, 1.1, 1.4, 1.9)]
    assert double == sorted(double, reverse=True)
    assert 0.18 < double[3] < 0.24  # two tenths of the stride at a usual 1.4 m/s
