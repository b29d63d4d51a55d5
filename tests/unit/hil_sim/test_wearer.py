"""What ground and trunk feel: force curves against measured ones, Newton, centre of pressure."""

import random
import statistics
from itertools import pairwise

import pytest

from hil_sim.gait.activity import Activity, Label
from hil_sim.gait.gaits import GAITS
from hil_sim.gait.ground import level_humps, outward, vertical_grf
from hil_sim.gait.subject import NOMINAL_LEG_LENGTH, WearerSettings
from hil_sim.gait.walk import Shape, stance_share
from hil_sim.gait.wearer import GRAVITY
from hil_sim.sensors.faults import InsoleFaults
from hil_sim.sensors.insoles.insole_cobs import CELLS
from hil_sim.sensors.sole import Sole
from tests.unit.hil_sim.moving import DT, USUAL, Moment, Moving, stride_of

STANCE = [index / 100 for index in range(101)]
FAST = Shape(step_length=0.6, cycle_time=1.0, toe_height=0.06, trunk_angle=0.0)

# Landmarks of the vertical force measured on ten adults (Pataky et al. 2008): speed (m/s), then where in
# stance and how high (over the mean of stance) first peak, valley and second peak are.
LANDMARKS = [
    (1.093, (0.24, 1.28), (0.46, 1.02), (0.76, 1.43)),
    (1.443, (0.20, 1.42), (0.48, 0.81), (0.76, 1.47)),
    (1.950, (0.20, 1.65), (0.48, 0.55), (0.76, 1.43)),
]


@pytest.mark.parametrize(("speed", "first", "valley", "second"), LANDMARKS)
def test_vertical_force_has_the_measured_humps(
    speed: float, first: tuple[float, float], valley: tuple[float, float], second: tuple[float, float]
) -> None:
    force = [level_humps(speed).at(place) for place in STANCE]
    mean = statistics.fmean(force)
    peaks = [i for i in range(1, 100) if force[i - 1] < force[i] >= force[i + 1]]
    lowest = min(range(peaks[0], peaks[-1]), key=force.__getitem__)
    assert len(peaks) == 2
    for found, (place, height) in zip((peaks[0], lowest, peaks[1]), (first, valley, second), strict=True):
        assert STANCE[found] == pytest.approx(place, abs=0.04)
        assert force[found] / mean == pytest.approx(height, rel=0.12)
    assert force[0] == force[100] == 0.0


@pytest.mark.parametrize("speed", [0.1, 0.5, 1.1, 1.9])
def test_two_feet_carry_one_body_weight_on_average(speed: float) -> None:
    share = stance_share(speed)
    force = [vertical_grf(place, level_humps(speed), share) for place in STANCE]
    assert 2.0 * share * statistics.fmean(force[:-1]) == pytest.approx(1.0, abs=0.002)


def test_slow_walking_has_hardly_any_humps() -> None:
    force = [vertical_grf(place, level_humps(0.2), stance_share(0.2)) for place in STANCE]
    assert 0.95 < max(force) < 1.06
    assert min(force[25:75]) > 0.9


def carried(moments: list[Moment], mass: float) -> list[float]:
    """By how much forces and acceleration disagree (N)."""
    return [abs(moment.vertical - mass * (GRAVITY + moment.trunk.acceleration[2])) for moment in moments]


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("shape", [USUAL, FAST])
def test_newton_holds_in_every_gait_and_a_stride_carries_the_weight(gait: Activity, shape: Shape) -> None:
    moments = stride_of(gait, shape)
    weight = 90.0 * GRAVITY
    assert max(carried(moments, 90.0)) < 1e-6
    assert statistics.fmean(moment.vertical for moment in moments) == pytest.approx(weight, rel=0.01)
    for axis in range(3):
        mean = statistics.fmean(moment.trunk.acceleration[axis] for moment in moments)
        assert mean == pytest.approx(0.0, abs=0.1)


def test_newton_holds_in_everything_that_is_no_gait() -> None:
    moving = Moving()
    moments = [
        *moving.do(Activity.SIT, 4.0),
        *moving.do(Activity.STAND, 4.0),
        *moving.do(Activity.WALK, 4.0),
        *moving.do(Activity.STUMBLE, 4.0),
        *moving.do(Activity.FALL, 4.0),
        *moving.do(Activity.STAND, 5.0),
    ]
    assert max(carried(moments, 90.0)) < 1e-6
    assert all(foot.force >= 0.0 for moment in moments for foot in moment.feet)


def test_the_acceleration_of_sitting_down_and_getting_up_takes_the_trunk_to_the_seat_and_back() -> None:
    moving = Moving()

    def way(activity: Activity, axis: int) -> float:
        place = speed = 0.0
        for moment in moving.do(activity, 3.0):
            speed += moment.trunk.acceleration[axis] * DT
            place += speed * DT
        assert speed == pytest.approx(0.0, abs=0.01)
        return place

    thigh = NOMINAL_LEG_LENGTH / 2.0  # from upright to nearly level
    assert way(Activity.SIT, axis=2) == pytest.approx(-0.9 * thigh, abs=0.04)
    assert way(Activity.STAND, axis=2) == pytest.approx(0.9 * thigh, abs=0.04)
    assert way(Activity.SIT, axis=0) == pytest.approx(-0.9 * thigh, abs=0.04)
    assert way(Activity.STAND, axis=0) == pytest.approx(0.9 * thigh, abs=0.04)


def test_getting_up_loads_the_feet_with_more_than_the_body() -> None:
    moving = Moving()
    moving.go(Activity.SIT, 4.0)
    seated = moving.do(Activity.SIT, 1.0)
    assert all(0.1 < moment.vertical / 882.6 - moment.support / 882.6 < 0.3 for moment in seated)
    rising = moving.do(Activity.STAND, 3.0)
    both = [moment.feet[0].force + moment.feet[1].force for moment in rising]
    assert 1.03 < max(both) / 882.6 < 1.3
    assert both[-1] == pytest.approx(882.6, rel=0.01)
    assert {moment.label for moment in rising} == {Label.SIT_TO_STAND, Label.STAND}


@pytest.mark.parametrize("gait", [Activity.WALK, Activity.STAIRS_UP, Activity.RAMP_UP, Activity.TURN_LEFT])
def test_the_centre_of_pressure_goes_from_heel_to_toe(gait: Activity) -> None:
    moments = [moment for moment in stride_of(gait) if moment.feet[0].force > 20.0]
    way = sorted((moment.phases[0], moment.feet[0].cop_x) for moment in moments)
    places = [x for _, x in way]
    assert all(b > a - 1e-9 for a, b in pairwise(places))
    assert places[0] == pytest.approx(GAITS[gait].path.start, abs=0.015)
    assert places[-1] == pytest.approx(0.205, abs=0.012)


# How far along its way the centre of pressure is at shares of stance (means of Pataky et al. 2014).
PROGRESS = [(0.2, 0.20), (0.4, 0.36), (0.6, 0.68), (0.8, 0.79), (0.9, 0.86)]


@pytest.mark.parametrize(("place", "progress"), PROGRESS)
def test_the_centre_of_pressure_is_on_its_way_where_it_was_measured(place: float, progress: float) -> None:
    path = GAITS[Activity.WALK].path
    assert (path.at(place) - path.start) / (path.end - path.start) == pytest.approx(progress, abs=0.09)


def test_the_pressure_rolls_outward_and_ends_under_the_big_toe() -> None:
    sideways = [outward(place) for place in STANCE]
    assert 0.5 < STANCE[sideways.index(max(sideways))] < 0.7
    assert sideways[-1] < 0.0


@pytest.mark.parametrize("gait", GAITS)
def test_the_centre_of_pressure_stays_within_the_foot(gait: Activity) -> None:
    for moment in stride_of(gait):
        for foot in moment.feet:
            assert 0.0 < foot.cop_x < 0.24
            assert abs(foot.cop_y) < 0.02


def test_the_cells_carry_the_feet_and_load_from_the_heel_to_the_toes() -> None:
    sole = Sole(CELLS, False, InsoleFaults(), random.Random(0))
    heel, toes = (
        [n for n, cell in enumerate(CELLS) if low < cell.x < high] for low, high in ((0, 0.06), (0.2, 0.3))
    )
    for moment in stride_of(Activity.WALK):
        foot, stance = moment.feet[0], moment.phases[0] / stance_share(USUAL.speed)
        pascal = sole.pressures(foot)
        forces = [pressure * cell.area for pressure, cell in zip(pascal, CELLS, strict=True)]
        assert sum(forces) == pytest.approx(foot.force)
        assert max(pascal) < 600e3
        if 0.05 < stance < 0.2:
            assert sum(forces[n] for n in heel) > 5.0 * sum(forces[n] for n in toes)
        if 0.85 < stance < 0.98:
            assert sum(forces[n] for n in toes) > 5.0 * sum(forces[n] for n in heel)


def test_feet_alternate_with_the_double_support_of_the_speed() -> None:
    moments = stride_of(Activity.WALK)
    loaded = [(moment.feet[0].force > 1.0, moment.feet[1].force > 1.0) for moment in moments]
    both = loaded.count((True, True)) / len(loaded)
    assert loaded.count((False, False)) == 0
    assert both == pytest.approx(2.0 * stance_share(USUAL.speed) - 1.0, abs=0.03)


def test_the_trunk_accelerates_away_from_the_foot_that_carries_it() -> None:
    for moment in stride_of(Activity.WALK):
        if moment.feet[1].force < 1.0:
            assert moment.trunk.acceleration[1] < 0.0  # on the left foot: to the right


def test_forces_are_those_of_the_body() -> None:
    light = stride_of(Activity.WALK, who=WearerSettings(mass=60.0))
    assert statistics.fmean(moment.vertical for moment in light) == pytest.approx(60.0 * GRAVITY, rel=0.01)


def test_an_impaired_leg_is_loaded_less_and_shorter_and_swings_stiffly() -> None:
    moments = stride_of(Activity.WALK, who=WearerSettings(impairment=(1.0, 0.0)))
    left, right = ([moment.feet[side].force for moment in moments] for side in (0, 1))
    assert statistics.fmean(left) < 0.9 * statistics.fmean(right)
    assert sum(force > 1.0 for force in left) < sum(force > 1.0 for force in right)
    knees = [max(moment.legs[side].knee for moment in moments) for side in (0, 1)]
    assert knees[0] < 0.8 * knees[1]
    assert statistics.fmean(moment.vertical for moment in moments) == pytest.approx(882.6, rel=0.01)


def test_in_standing_the_load_sways_a_little_between_the_feet() -> None:
    forces = [moment.feet[0].force / 882.6 for moment in Moving().do(Activity.STAND, 20.0)]
    assert 0.45 < min(forces) < 0.49
    assert 0.51 < max(forces) < 0.55
