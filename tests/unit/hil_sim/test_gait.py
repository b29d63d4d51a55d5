"""The wearer's gait: angles, forces, trunk."""

import math
from itertools import pairwise

import pytest

from hil_sim.gait.curves import measured
from hil_sim.gait.generator import Activity, Generator
from hil_sim.gait.walk import STANCE, Shape, hip_range, leg
from hil_sim.gait.wearer import Wearer, vertical_grf

USUAL = Shape(step_length=0.4, cycle_time=1.6, toe_height=0.06, trunk_angle=0.0)
PHASES = [index / 200 for index in range(200)]


def shaped(step_length: float = 0.4, toe_height: float = 0.06) -> Shape:
    return Shape(step_length, 1.6, toe_height, 0.0)


def test_the_measured_curves_are_those_of_the_table() -> None:
    slowest, *_, fastest = measured()
    assert math.degrees(slowest.hip(0.0)) == pytest.approx(30.195, abs=0.1)
    assert math.degrees(slowest.hip(0.56)) == pytest.approx(1.506, abs=0.2)
    assert math.degrees(fastest.knee(0.72)) == pytest.approx(61.879, abs=0.7)


def test_curves_are_periodic_and_smooth() -> None:
    for joint in range(3):
        angles = [leg(phase / 1000 % 1.0, USUAL)[joint] for phase in range(1001)]
        assert angles[-1] == angles[0]
        assert max(abs(b - a) for a, b in pairwise(angles)) < 0.012


@pytest.mark.parametrize("step_length", [0.3, 0.4, 0.6])
def test_the_thigh_trails_behind_the_trunk_in_late_stance(step_length: float) -> None:
    hips = [math.degrees(leg(phase, shaped(step_length)).hip) for phase in PHASES]
    trailing = min(hips)
    assert -25.0 < trailing < -3.0
    assert 0.4 < PHASES[hips.index(trailing)] < STANCE


@pytest.mark.parametrize("step_length", [0.2, 0.3, 0.4, 0.5, 0.6])
def test_the_hips_range_is_what_the_step_length_needs(step_length: float) -> None:
    hips = [leg(phase, shaped(step_length)).hip for phase in PHASES]
    assert max(hips) - min(hips) == pytest.approx(hip_range(step_length), rel=0.03)


def test_toe_height_bends_knee_and_ankle_in_swing_and_leaves_stance() -> None:
    swing, stance = STANCE + (1 - STANCE) / 2, STANCE / 2
    low, high = leg(swing, shaped(toe_height=0.02)), leg(swing, shaped(toe_height=0.12))
    assert high.knee - low.knee > 0.2
    assert high.ankle - low.ankle > 0.1
    assert leg(stance, shaped(toe_height=0.02)) == leg(stance, shaped(toe_height=0.12))


def walking(shape: Shape = USUAL, seconds: float = 4.0) -> Generator:
    generator = Generator(shape)
    for _ in range(round(seconds * 100)):
        generator.step(0.01, Activity.WALK, shape)
    return generator


def test_left_and_right_walk_in_anti_phase() -> None:
    generator = walking()
    left, _ = generator.legs()
    for _ in range(80):  # half a cycle
        generator.step(0.01, Activity.WALK, USUAL)
    _, right = generator.legs()
    assert right == pytest.approx(left, abs=1e-9)


def test_a_changed_cycle_time_changes_the_cadence() -> None:
    generator = walking()
    slow = Shape(0.4, 3.2, 0.06, 0.0)
    for _ in range(400):
        generator.step(0.01, Activity.WALK, slow)
    before = generator.phase
    for _ in range(32):
        generator.step(0.01, Activity.WALK, slow)
    assert (generator.phase - before) % 1.0 == pytest.approx(0.1, abs=0.001)


def test_between_walking_and_sitting_one_stands() -> None:
    generator = walking()
    both = []
    for _ in range(600):
        generator.step(0.01, Activity.SIT, USUAL)
        both.append((generator.walking, generator.sitting))
    assert all(walk == 0.0 or sit == 0.0 for walk, sit in both)
    assert both[-1] == (0.0, 1.0)


def test_the_trunk_leans_as_asked_and_hips_follow() -> None:
    upright, leaning = Generator(USUAL), Generator(USUAL)
    lean = Shape(0.4, 1.6, 0.06, 0.2)
    for _ in range(500):
        leaning.step(0.01, Activity.STAND, lean)
    assert leaning.trunk == pytest.approx(0.2, abs=1e-4)
    assert leaning.legs()[0].hip - upright.legs()[0].hip == pytest.approx(0.2, abs=1e-4)


def test_vertical_force_has_two_humps_and_a_valley() -> None:
    force = [vertical_grf(index / 100) for index in range(101)]
    humps = [i for i in range(1, 100) if force[i - 1] < force[i] >= force[i + 1]]
    assert len(humps) == 2
    first, second = humps
    assert 15 <= first <= 30
    assert 70 <= second <= 85
    assert 1.0 < force[first] < 1.3
    assert min(force[first:second]) < 0.95 * force[first]
    assert force[0] == force[100] == 0.0


def test_both_feet_carry_the_body_over_a_stride_and_alternate() -> None:
    generator = walking()
    wearer = Wearer(generator)
    total, single = 0.0, set[str]()
    for _ in range(160):
        left, right = wearer.feet(0.0)
        total += left.force + right.force
        if right.force < 1.0 < left.force:
            single.add("left")
        if left.force < 1.0 < right.force:
            single.add("right")
        generator.step(0.01, Activity.WALK, USUAL)
    assert total / 160 == pytest.approx(wearer.weight, rel=0.01)
    assert single == {"left", "right"}


def test_the_centre_of_pressure_goes_from_heel_to_toe() -> None:
    generator = walking()
    wearer = Wearer(generator)
    way = []
    for _ in range(320):
        generator.step(0.01, Activity.WALK, USUAL)
        if 0.02 < generator.phase < STANCE - 0.02:
            way.append((generator.phase, wearer.feet(0.0)[0].cop_x))
    way.sort()
    places = [x for _, x in way]
    assert places == sorted(places)
    assert places[0] < 0.05
    assert places[-1] > 0.18


def test_seated_feet_carry_little() -> None:
    generator = Generator(USUAL)
    for _ in range(400):
        generator.step(0.01, Activity.SIT, USUAL)
    wearer = Wearer(generator)
    left, right = wearer.feet(0.0)
    assert 0.1 * wearer.weight < left.force + right.force < 0.3 * wearer.weight
