"""Activities: what follows what, smooth ways between all of them, turning, stumble and fall, subjects."""

import math
import random
import statistics
from dataclasses import replace
from itertools import groupby, pairwise, permutations

import pytest

from hil_sim.gait.activity import Activity, Label
from hil_sim.gait.gaits import GAITS
from hil_sim.gait.subject import NOMINAL, subject
from hil_sim.gait.wearer import GRAVITY
from hil_sim.sensors.faults import ImuFaults
from hil_sim.sensors.trunk_imu import TrunkImu
from tests.unit.hil_sim.moving import USUAL, Moment, Moving, stride_of


def labels(moments: list[Moment]) -> list[Label]:
    """What was done, in order, each once."""
    return [label for label, _ in groupby(moment.label for moment in moments)]


def through_all_pairs() -> list[Activity]:
    """A tour in which each activity follows each other one once (Hierholzer's)."""
    ways = {one: [other for other in Activity if other is not one] for one in Activity}
    for after in ways.values():
        random.Random(3).shuffle(after)
    on_the_way, tour = [Activity.STAND], []
    while on_the_way:
        after = ways[on_the_way[-1]]
        (on_the_way.append(after.pop()) if after else tour.append(on_the_way.pop()))
    return tour[::-1]


def test_the_tour_goes_from_each_activity_to_each_other() -> None:
    assert set(pairwise(through_all_pairs())) == set(permutations(Activity, 2))


def test_no_angle_and_no_velocity_jumps_between_any_two_activities() -> None:
    """Commands come at odd times, also in the middle of a transition; the most are a fall's."""
    dt, pause = 0.01, random.Random(4)
    moving = Moving(replace(USUAL, step_length=0.5, cycle_time=1.4), seed=1)
    generator = moving.generator
    before: tuple[float, ...] = (*generator.legs()[0], *generator.legs()[1], generator.trunk)
    speeds: tuple[float, ...] = (0.0,) * len(before)
    for activity in through_all_pairs():
        for _ in range(round(pause.uniform(0.1, 1.3) / dt)):
            generator.step(dt, activity, moving.shape)
            now = (*generator.legs()[0], *generator.legs()[1], generator.trunk)
            after = tuple((b - a) / dt for a, b in zip(before, now, strict=True))
            assert max(map(abs, after)) < 8.0
            assert max(abs(b - a) for a, b in zip(speeds, after, strict=True)) < 110.0 * dt
            before, speeds = now, after


def test_changed_parameters_bend_the_motion_without_a_jump() -> None:
    moving = Moving()
    moving.go(Activity.WALK, 4.0)
    moving.shape = replace(USUAL, step_length=0.6, cycle_time=1.2, toe_height=0.12, trunk_angle=0.3)
    knees = [moment.legs[0].knee for moment in moving.do(Activity.WALK, 2.0, dt=0.002)]
    speeds = [(b - a) / 0.002 for a, b in pairwise(knees)]
    assert max(abs(b - a) for a, b in pairwise(speeds)) < 0.25


WAYS = [
    ((Activity.WALK, Activity.SIT), ["walk", "stand", "stand_to_sit", "sit"]),
    ((Activity.SIT, Activity.STAIRS_UP), ["sit", "sit_to_stand", "stand", "stairs_up"]),
    ((Activity.STAIRS_UP, Activity.RAMP_DOWN), ["stairs_up", "ramp_down"]),
    ((Activity.WALK, Activity.FALL), ["walk", "fall", "lying"]),
    ((Activity.SIT, Activity.FALL), ["sit", "sit_to_stand", "stand", "fall", "lying"]),
    ((Activity.FALL, Activity.TURN_LEFT), ["lying", "get_up", "stand", "turn_left"]),
]


@pytest.mark.parametrize(("ways", "seen"), WAYS)
def test_what_is_done_between_two_activities(ways: tuple[Activity, Activity], seen: list[str]) -> None:
    moving = Moving()
    moving.go(ways[0], 5.0)
    assert labels([*moving.do(ways[0], 0.1), *moving.do(ways[1], 10.0)]) == seen


def test_sitting_down_takes_its_time_and_is_not_broken_off() -> None:
    moving = Moving()
    moving.go(Activity.SIT, 1.0)
    moments = moving.do(Activity.STAND, 5.0)
    assert labels(moments) == ["stand_to_sit", "sit", "sit_to_stand", "stand"]
    rising = [moment for moment in moments if moment.label is Label.SIT_TO_STAND]
    assert len(rising) * 0.01 == pytest.approx(2.5, abs=0.03)


def test_the_trunk_leans_over_the_feet_before_the_seat_is_left() -> None:
    moving = Moving()
    moving.go(Activity.SIT, 4.0)
    moments = moving.do(Activity.STAND, 3.0)
    leaning = max(range(len(moments)), key=lambda index: moments[index].trunk.pitch)
    left = next(index for index, moment in enumerate(moments) if moment.support == 0.0)
    assert moments[leaning].trunk.pitch > 0.4
    assert abs(leaning - left) < 30


def test_between_walking_and_sitting_one_stands() -> None:
    moving = Moving()
    moving.go(Activity.WALK, 4.0)
    generator = moving.generator
    for _ in range(600):
        generator.step(0.01, Activity.SIT, USUAL)
        assert generator.walking == 0.0 or generator.sitting == 0.0
    assert (generator.walking, generator.sitting) == (0.0, 1.0)


def test_the_trunk_leans_as_asked_and_hips_follow() -> None:
    upright, leaning = Moving(), Moving()
    leaning.shape = replace(USUAL, trunk_angle=0.2)
    leaning.go(Activity.STAND, 5.0)
    assert leaning.generator.trunk == pytest.approx(0.2, abs=1e-4)
    hips = [moving.generator.legs()[0].hip for moving in (upright, leaning)]
    assert hips[1] - hips[0] == pytest.approx(0.2, abs=1e-4)


# -- gaits ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gait", sorted(set(GAITS) - {Activity.TURN_LEFT, Activity.TURN_RIGHT}))
def test_left_and_right_are_alike_half_a_stride_apart(gait: Activity) -> None:
    moments = stride_of(gait)
    for early, late in zip(moments[:160], moments[80:], strict=False):
        assert early.legs[0] == pytest.approx(late.legs[1], abs=1e-9)
        assert early.feet[0].force == pytest.approx(late.feet[1].force, abs=1e-6)


def test_a_changed_cycle_time_changes_the_cadence() -> None:
    moving = Moving(replace(USUAL, cycle_time=3.2))
    moving.go(Activity.WALK, 4.0)
    before = moving.generator.phase
    moving.go(Activity.WALK, 0.32)
    assert (moving.generator.phase - before) % 1.0 == pytest.approx(0.1, abs=0.001)


@pytest.mark.parametrize(("turn", "inner"), [(Activity.TURN_LEFT, 0), (Activity.TURN_RIGHT, 1)])
def test_turning_goes_round_with_shorter_steps_inside(turn: Activity, inner: int) -> None:
    moments = stride_of(turn)
    seconds = moments[-1].time_s - moments[0].time_s
    rate = (moments[-1].trunk.yaw - moments[0].trunk.yaw) / seconds
    assert rate == pytest.approx((1.0 - 2.0 * inner) * 0.75, abs=0.05)
    ranges = [
        max(moment.legs[side].hip for moment in moments) - min(moment.legs[side].hip for moment in moments)
        for side in (0, 1)
    ]
    assert ranges[inner] < 0.85 * ranges[1 - inner]


def test_after_whole_turns_the_imu_still_tells_a_yaw_within_half_a_turn() -> None:
    moving, imu = Moving(), TrunkImu(ImuFaults(), random.Random(0))
    told = [imu.measure(moment.trunk, 0.01) for moment in moving.do(Activity.TURN_LEFT, 14.0)]
    assert moving.generator.heading > math.tau
    assert all(abs(motion.angles[2]) <= math.pi for motion in told)
    assert max(abs(motion.rate[2]) for motion in told) < 2.0


def test_after_a_turn_the_way_goes_where_the_trunk_looks() -> None:
    """Braking and pushing turn with the wearer: after a quarter they lie along y."""
    moving = Moving()
    while moving.generator.heading < math.pi / 2.0:
        moving.go(Activity.TURN_LEFT, 0.01)
    moving.go(Activity.STAND, 4.0)
    moving.generator.heading = math.pi / 2.0
    moving.go(Activity.WALK, 3.0)
    ahead = [moment.trunk.acceleration for moment in moving.do(Activity.WALK, 1.6)]
    straight = [moment.trunk.acceleration for moment in stride_of(Activity.WALK)]
    assert max(y for _, y, _ in ahead) == pytest.approx(max(x for x, _, _ in straight), rel=0.05)


# -- mishaps --------------------------------------------------------------------------------------------


def test_a_stumble_holds_the_swinging_leg_pitches_the_trunk_and_is_recovered() -> None:
    moving = Moving()
    moving.go(Activity.WALK, 4.0)
    moments = moving.do(Activity.STUMBLE, 8.0)
    assert labels(moments) == ["walk", "stumble", "walk"]
    during = [moment for moment in moments if moment.label is Label.STUMBLE]
    assert len(during) * 0.01 == pytest.approx(1.4, abs=0.03)
    side = 0 if 0.65 < during[0].phases[0] < 0.75 else 1
    advance = [(b.phases[side] - a.phases[side]) % 1.0 for a, b in pairwise(during)]
    usual = 0.01 / USUAL.cycle_time
    assert min(advance[:25]) < 0.1 * usual  # held
    assert max(advance[20:60]) > 1.3 * usual  # quick recovery
    other = [(b.phases[1 - side] - a.phases[1 - side]) % 1.0 for a, b in pairwise(during)]
    assert other == pytest.approx([usual] * len(other))
    pitches = [moment.trunk.pitch for moment in during]
    assert max((b - a) / 0.01 for a, b in pairwise(pitches)) > 1.5
    usual_knee = max(moment.legs[side].knee for moment in stride_of(Activity.WALK))
    assert max(moment.legs[side].knee for moment in during) > usual_knee + 0.2
    assert moments[-1].trunk.pitch == pytest.approx(0.0, abs=0.05)


def test_one_command_is_one_stumble_and_the_next_another() -> None:
    moving = Moving()
    moving.go(Activity.WALK, 4.0)
    once = moving.do(Activity.STUMBLE, 10.0)
    again = [*moving.do(Activity.WALK, 0.5), *moving.do(Activity.STUMBLE, 6.0)]
    assert labels(once).count(Label.STUMBLE) == 1
    assert labels(again).count(Label.STUMBLE) == 1


def test_a_fall_takes_the_trunk_down_and_the_feet_off_the_ground() -> None:
    moving = Moving()
    moving.go(Activity.WALK, 4.0)
    moments = moving.do(Activity.FALL, 4.0)
    assert labels(moments) == ["fall", "lying"]
    fall = [moment for moment in moments if moment.label is Label.FALL]
    assert len(fall) * 0.01 == pytest.approx(0.85, abs=0.03)
    felt = [
        math.hypot(*moment.trunk.acceleration[:2], moment.trunk.acceleration[2] + GRAVITY) for moment in fall
    ]
    assert min(felt) < 0.6 * GRAVITY
    assert 4.0 * GRAVITY < max(felt) < 8.0 * GRAVITY
    assert felt.index(min(felt)) < felt.index(max(felt))
    lying = moments[-1]
    assert lying.feet[0].force == lying.feet[1].force == 0.0
    assert lying.support == pytest.approx(882.6, rel=0.01)
    assert lying.trunk.pitch == pytest.approx(1.2, abs=0.01)


def test_the_trunk_falls_as_far_as_it_is_high() -> None:
    moving = Moving()
    height = speed = 0.0
    for moment in moving.do(Activity.FALL, 3.0, dt=0.001):
        speed += moment.trunk.acceleration[2] * 0.001
        height += speed * 0.001
    assert speed == pytest.approx(0.0, abs=0.02)
    assert height == pytest.approx(-0.8, abs=0.03)


def test_who_lies_stays_until_told_to_get_up() -> None:
    moving = Moving()
    moving.go(Activity.FALL, 30.0)
    assert moving.generator.label is Label.LYING
    assert moving.generator.at_rest is Activity.FALL
    moments = moving.do(Activity.STAND, 6.0)
    assert labels(moments) == ["get_up", "stand"]
    assert moments[-1].feet[0].force == pytest.approx(441.3, rel=0.1)


# -- variation ------------------------------------------------------------------------------------------


def strides(moments: list[Moment]) -> list[float]:
    """Times from heel strike to heel strike of the left foot (s)."""
    strikes = [b.time_s for a, b in pairwise(moments) if b.phases[0] < 0.5 < a.phases[0]]
    return [b - a for a, b in pairwise(strikes)]


def test_strides_differ_as_in_people_and_repeat_with_the_seed() -> None:
    first = Moving(seed=1).do(Activity.WALK, 18.0)
    again, other = (Moving(seed=seed).do(Activity.WALK, 9.0) for seed in (1, 2))
    assert first[: len(again)] == again
    times = strides(first)[2:]
    assert 0.005 < statistics.stdev(times) / statistics.fmean(times) < 0.04
    assert strides(other)[2:] != strides(again)[2:]
    even = strides(Moving().do(Activity.WALK, 10.0))[2:]
    assert max(even) - min(even) < 0.011  # a step of the clock


def test_subjects_are_people_each_of_their_own_and_always_the_same() -> None:
    people = [subject(number) for number in range(1, 101)]
    assert people == [subject(number) for number in range(1, 101)]
    assert len({person.mass for person in people}) > 90
    assert all(60.0 < person.mass < 120.0 and 0.7 < person.leg_length < 1.0 for person in people)
    impaired = sum(max(person.impairment) > 0.0 for person in people)
    assert 10 < impaired < 40
    assert all(min(person.impairment) == 0.0 for person in people)
    assert subject(0) == NOMINAL


@pytest.mark.parametrize("number", [1, 7, 23])
def test_any_subject_obeys_newton_and_moves_within_the_joints(number: int) -> None:
    person = subject(number)
    moving = Moving(who=person, seed=number)
    moving.go(Activity.WALK, 3.0)
    moments = [*moving.do(Activity.WALK, 16.0), *moving.do(Activity.STAIRS_UP, 5.0)]
    weight = person.mass * GRAVITY
    assert statistics.fmean(moment.vertical for moment in moments) == pytest.approx(weight, rel=0.03)
    for moment in moments:
        assert moment.vertical == pytest.approx(person.mass * (GRAVITY + moment.trunk.acceleration[2]))
        assert all(math.radians(-60.0) < angle < math.radians(130.0) for leg in moment.legs for angle in leg)


def test_subjects_walk_differently() -> None:
    curves = [[moment.legs[0].knee for moment in stride_of(Activity.WALK, who=subject(n))] for n in (1, 2)]
    difference = [abs(a - b) for a, b in zip(*curves, strict=True)]
    assert statistics.fmean(difference) > math.radians(1.0)
