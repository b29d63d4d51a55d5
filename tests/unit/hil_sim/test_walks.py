"""People who walk differently: curves, timing, loads and pace are what the table says of each walk."""

import math
import random
import statistics
import tomllib
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from hil_sim import robot_file
from hil_sim.channels import UNITS, reported
from hil_sim.controller import CYCLE_TIME, STEP_LENGTH, ControllerState
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import SIDES, Exoskeleton
from hil_sim.gait.activity import Activity
from hil_sim.gait.gaits import LEFT, RIGHT
from hil_sim.gait.subject import subject
from hil_sim.gait.walk import Shape
from hil_sim.gait.walks import NAMES, ORDINARY, WALKS, own_walk
from hil_sim.gait.wearer import GRAVITY
from hil_sim.node.cob_id import is_valid
from hil_sim.sensors.faults import InsoleFaults
from hil_sim.sensors.insoles.insole_cobs import CELLS
from hil_sim.sensors.sole import Sole
from server_gui.core.processing.gait_events import EventKind, Leg
from server_gui.core.processing.pressure_events import PressureEvents
from tests.unit.hil_sim.moving import DT, Moment, Moving

AFFECTED, OTHER = LEFT, RIGHT  # of person 0
HIP, KNEE, ANKLE = range(3)
STEP = 0.02  # s
CONTACT = 0.03  # of the body weight


def shape_of(walk: str) -> Shape:
    step, cycle = (0.4, 1.6) if walk == ORDINARY else WALKS[walk].pace(0.4, 1.6)
    return Shape(step, cycle, 0.06, 0.0)


@cache
def strides(walk: str, person: int = 0) -> tuple[Moment, ...]:
    """An even one, after the start is over."""
    moving = Moving(shape_of(walk), subject(person, walk))
    for _ in range(80):
        moving.generator.step(0.05, Activity.WALK, shape_of(walk))
    return tuple(moving.do(Activity.WALK, shape_of(walk).cycle_time, STEP))


def degrees(walk: str, side: int, joint: int, within: tuple[float, float] = (0.0, 1.0)) -> list[float]:
    low, high = within
    moments = [moment for moment in strides(walk) if low <= moment.phases[side] <= high]
    return [math.degrees(moment.legs[side][joint]) for moment in moments]


def forces(walk: str, side: int) -> list[float]:
    """In body weights."""
    weight = subject(0, walk).mass * GRAVITY
    return [moment.feet[side].force / weight for moment in strides(walk)]


def stance(walk: str, side: int) -> float:
    return statistics.fmean(force > CONTACT for force in forces(walk, side))


@pytest.mark.parametrize("walk", NAMES)
@pytest.mark.parametrize("person", [0, 1])
def test_newton_holds_and_a_stride_carries_the_weight(walk: str, person: int) -> None:
    mass = subject(person, walk).mass
    moments = strides(walk, person)
    assert max(abs(m.vertical - mass * (GRAVITY + m.trunk.acceleration[2])) for m in moments) < 1e-6
    assert statistics.fmean(m.vertical for m in moments) == pytest.approx(mass * GRAVITY, rel=0.01)
    assert all(abs(m.trunk.acceleration[2]) < 3.0 for m in moments)  # nobody is thrown or dropped


@pytest.mark.parametrize("walk", NAMES)
@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_a_foot_is_loaded_from_phase_0_on_and_as_long_as_its_leg_is_in_stance(walk: str, side: int) -> None:
    struck = [
        b.phases[side]
        for a, b in pairwise((*strides(walk), strides(walk)[0]))
        if a.feet[side].force < 20.0 <= b.feet[side].force
    ]
    assert struck
    assert all(phase < 0.05 for phase in struck)
    share = Moving(shape_of(walk), subject(0, walk)).generator.stance_share(side)
    assert stance(walk, side) == pytest.approx(share, abs=0.06)


@pytest.mark.parametrize("walk", NAMES)
def test_joints_move_smoothly_within_what_they_can(walk: str) -> None:
    for side in (LEFT, RIGHT):
        for joint in (HIP, KNEE, ANKLE):
            angles = degrees(walk, side, joint)
            assert -55.0 < min(angles) <= max(angles) < 125.0  # the stops are at −60° and 130°
            assert max(abs(b - a) for a, b in pairwise(angles)) < 500.0 * STEP


def test_a_hemiparetic_knee_bends_little_and_its_foot_drops() -> None:
    ours, other = (max(degrees("hemiparetic", side, KNEE)) for side in (AFFECTED, OTHER))
    assert ours < 35.0 < other
    assert min(degrees("hemiparetic", AFFECTED, ANKLE, (0.8, 0.9))) < 0.0
    hips = [degrees("hemiparetic", side, HIP) for side in (AFFECTED, OTHER)]
    assert max(hips[AFFECTED]) - min(hips[AFFECTED]) < max(hips[OTHER]) - min(hips[OTHER])


def test_a_hemiparetic_leg_stands_shorter_carries_less_and_strikes_late() -> None:
    assert stance("hemiparetic", OTHER) > stance("hemiparetic", AFFECTED) + 0.03
    means = [statistics.fmean(forces("hemiparetic", side)) for side in (AFFECTED, OTHER)]
    assert means[AFFECTED] + means[OTHER] == pytest.approx(1.0, rel=0.01)
    assert 0.40 < means[AFFECTED] < 0.47
    when = strides("hemiparetic")[0].phases
    assert (when[RIGHT] - when[LEFT]) % 1.0 == pytest.approx(0.5 + WALKS["hemiparetic"].late)


def test_the_trunk_leans_away_from_the_hemiparetic_leg_that_swings() -> None:
    for person, way in ((0, 1.0), (1, -1.0)):
        side = AFFECTED if person == 0 else OTHER
        rolls = [m.trunk.roll for m in strides("hemiparetic", person) if 0.75 < m.phases[side] < 0.9]
        usual = [m.trunk.roll for m in strides(ORDINARY, person) if 0.75 < m.phases[side] < 0.9]
        assert way * (statistics.fmean(rolls) - statistics.fmean(usual)) > math.radians(1.5)


def test_a_crouched_knee_is_bent_by_more_than_20_degrees_all_through_stance() -> None:
    for side in (LEFT, RIGHT):
        assert min(degrees("crouch", side, KNEE)) > 20.0 > min(degrees(ORDINARY, side, KNEE))
        assert min(degrees("crouch", side, HIP)) > 10.0
        assert min(degrees("crouch", side, ANKLE, (0.1, 0.6))) > 5.0
    standing = Moving(who=subject(0, "crouch")).do(Activity.STAND, 0.1)[-1].legs[LEFT]
    assert math.degrees(standing.knee) > 30.0


def test_in_steppage_the_foot_hangs_and_hip_and_knee_lift_it() -> None:
    assert min(degrees("steppage", AFFECTED, ANKLE, (0.75, 0.95))) < -15.0
    assert max(degrees("steppage", AFFECTED, ANKLE, (0.0, 0.02))) < -5.0  # toe first
    for joint, more in ((HIP, 8.0), (KNEE, 14.0)):
        usual = max(degrees("steppage", OTHER, joint))
        assert max(degrees("steppage", AFFECTED, joint)) > usual + more
    first = [m.feet[AFFECTED].cop_x for m in strides("steppage") if 0.0 <= m.phases[AFFECTED] < 0.03]
    assert min(first) > 0.1


def test_the_slow_stand_longer_on_both_feet() -> None:
    assert stance("slow", LEFT) > stance(ORDINARY, LEFT) + 0.03
    assert stance("slow", LEFT) == pytest.approx(stance("slow", RIGHT), abs=0.02)


def test_crutches_take_a_quarter_of_both_legs_or_half_of_one() -> None:
    ordinary = statistics.fmean(forces(ORDINARY, LEFT))
    for side in (LEFT, RIGHT):
        unloaded = statistics.fmean(forces("crutches_two_point", side))
        assert unloaded == pytest.approx(0.75 * ordinary, rel=0.02)
    affected, other = (statistics.fmean(forces("crutches_three_point", side)) for side in (AFFECTED, OTHER))
    assert affected == pytest.approx(0.5 * ordinary, rel=0.08)
    assert other == pytest.approx(ordinary, rel=0.1)
    assert max(forces("crutches_three_point", AFFECTED)) < 0.6


def test_nobody_leans_on_crutches_who_sits() -> None:
    moving = Moving(who=subject(0, "crutches_three_point"))
    seated = moving.do(Activity.SIT, 5.0)[-1]
    assert seated.feet[LEFT].force == pytest.approx(seated.feet[RIGHT].force, rel=0.1)


@pytest.mark.parametrize("walk", WALKS)
def test_each_person_has_a_side_and_a_measure_of_their_own(walk: str) -> None:
    left, right, again = (own_walk(walk, number) for number in (2, 3, 2))
    assert left == again
    assert left != own_walk(walk, 4)
    table = WALKS[walk]
    assert own_walk(walk, 0).limbs == (table.affected, table.other)
    assert left.late * right.late <= 0.0
    assert (left.limbs[LEFT] == left.limbs[RIGHT]) == (table.affected == table.other)
    assert subject(2, walk).impairment == (0.0, 0.0)


@pytest.mark.parametrize("walk", WALKS)
def test_every_pace_is_one_that_the_controller_allows(walk: str) -> None:
    robot = Exoskeleton(walk=walk)
    for pace in ((0.2, 1.0), (0.6, 4.0), (0.2, 4.0), (0.6, 1.0)):
        own = WALKS[walk].pace(*pace)
        robot.controller.go(Activity.WALK, own)  # raises where a limit forbids it
    for key, low, high in ((STEP_LENGTH, 200, 600), (CYCLE_TIME, 1000, 4000)):
        entry = robot.controller.dictionary[key]
        assert (entry.low, entry.high) == (low, high)  # as for everybody


def test_slow_is_0_2_to_0_5_metres_a_second() -> None:
    steps, cycles = (0.2, 0.6), (1.0, 2.4)
    speeds = [Shape(*WALKS["slow"].pace(step, cycle), 0.06, 0.0).speed for step in steps for cycle in cycles]
    assert [min(speeds), max(speeds)] == pytest.approx([0.2, 0.5])


def test_a_robot_begins_at_a_pace_of_its_wearers_walk_and_an_ordinary_one_as_ever() -> None:
    assert Exoskeleton(walk="slow").controller.dictionary.number(STEP_LENGTH) == 300
    assert Exoskeleton().controller.dictionary.number(STEP_LENGTH) == 400


def test_an_unknown_walk_is_refused_by_name() -> None:
    with pytest.raises(SimulatorError, match="no walk 'moonwalk': ordinary, slow, hemiparetic"):
        Exoskeleton(walk="moonwalk")


def heel_strikes(walk: str, person: int, seconds: float = 6.0) -> tuple[list[float], list[float]]:
    """True ones, and those that the desk finds in what a noisy insole says of the affected foot (s)."""
    side = person % 2
    moving = Moving(shape_of(walk), subject(person, walk), seed=person)
    sole = Sole(CELLS, side == RIGHT, InsoleFaults(), random.Random(person))
    detector, true, found, before = PressureEvents(Leg.LEFT), [], [], True
    for number in range(round(seconds / DT)):
        moving.generator.step(DT, Activity.WALK, moving.shape)
        feet, now_s = moving.wearer.feet(number * DT), number * DT
        own, other = feet[side], feet[1 - side]
        felt = sole.measure(own, other, DT).pascal
        force = sum(pascal * cell.area for pascal, cell in zip(felt, CELLS, strict=True))
        event = detector.feed(round(now_s * 1e9), force)
        if event is not None and event.kind is EventKind.HEEL_STRIKE:
            found.append(event.stamp_ns / 1e9)
        contact = own.force >= 20.0
        if contact and not before:
            true.append(now_s)
        before = contact
    return true, found


def matched(true: Sequence[float], found: Sequence[float]) -> int:
    return sum(any(abs(one - other) <= 0.05 for other in found) for one in true)


@pytest.mark.parametrize("walk", NAMES)
def test_the_desk_finds_the_heel_strikes_of_the_affected_foot(walk: str) -> None:
    true, found = heel_strikes(walk, person=7)
    assert len(true) >= 2
    assert matched(true, found) == len(true)
    assert len(found) <= len(true) + 1


@pytest.mark.parametrize("side", SIDES)
def test_the_file_of_a_robot_on_one_leg_describes_that_leg_alone(side: str, tmp_path: Path) -> None:
    robot = Exoskeleton(assists=side)
    file = tomllib.loads(robot_file.text(tmp_path, robot_file.virtual_bus("x"), robot))
    assert set(file["joint"]) == {f"{side}_{joint}" for joint in ("hip", "knee", "ankle")}
    others = [name for name in file["parameter"] if name.partition(".")[0] in robot.absent]
    assert not others
    assert len(file["insole"]) == 2


@pytest.mark.parametrize(("side", "absent"), [("left", (3, 4, 5)), ("right", (0, 1, 2))])
def test_no_reset_brings_pdos_to_the_absent_leg_back(side: str, absent: tuple[int, ...]) -> None:
    dictionary = Exoskeleton(assists=side).controller.dictionary
    for place in range(6):
        for key in ((0x1400 + place, 1), (0x1801 + place, 1)):
            entry = dictionary[key]
            held = (entry.value, entry.default, entry.commissioned)
            valid = {is_valid(int(one)) for one in held if one is not None}
            assert valid == {place not in absent}


def test_a_robot_on_one_leg_leaves_the_other_legs_node_ids_alone() -> None:
    robot = Exoskeleton(assists="left")
    heard: set[int] = set()
    robot.bus.attach("listener", lambda frame, _: heard.add(frame.cob_id))
    robot.power_on()
    robot.clock.run_until(1_500_000_000)
    assert robot.controller.controller_state is ControllerState.RUNNING
    others = {node for cob_id in heard if (node := cob_id & 0x7F) in (4, 5, 6)}
    assert not others
    assert {0x201, 0x202, 0x203} <= heard
    values = dict(zip(UNITS, reported(robot), strict=True))
    assert values["left_hip.position"] != pytest.approx(math.radians(4.0), abs=0.01)
    assert all(values[f"{foot}_insole.force"] is not None for foot in ("left", "right"))
