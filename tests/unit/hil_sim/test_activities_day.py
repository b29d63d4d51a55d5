"""Timetables: what a day holds, that it repeats, and that the robot follows it."""

import math
from itertools import islice

import pytest

from hil_sim.controller import ControllerState
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.gait.activity import Activity, Label
from hil_sim.gait.timetable import Entry, day, timetable
from hil_sim.without_bus import BareExoskeleton


def test_a_round_of_a_day_holds_everything_and_ends_with_a_fall() -> None:
    entries = list(islice(day(1), 15))
    assert {entry.activity for entry in entries} == set(Activity)
    assert [entry.activity for entry in entries[-2:]] == [Activity.FALL, Activity.STAND]
    assert 120.0 < sum(entry.seconds for entry in entries) < 360.0
    speeds = [2.0 * e.pace[0] / e.pace[1] for e in entries if e.activity is Activity.WALK and e.pace]
    assert min(speeds) < 0.4
    assert max(speeds) > 0.75


def test_a_day_repeats_with_its_seed_and_its_rounds_differ() -> None:
    first, again, other = (list(islice(day(seed), 40)) for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert [entry.activity for entry in first[1:15]] != [entry.activity for entry in first[15:29]]


@pytest.mark.parametrize("seed", range(20))
def test_no_pace_of_a_day_is_beyond_what_the_controller_takes(seed: int) -> None:
    for entry in islice(day(seed), 60):
        step_length, cycle_time = entry.pace or (0.4, 1.6)
        assert 0.2 <= step_length <= 0.6
        assert 1.0 <= cycle_time <= 4.0


@pytest.mark.parametrize("scenario", Scenario)
def test_every_scenario_has_a_beginning(scenario: Scenario) -> None:
    entry = next(timetable(scenario, 0))
    assert isinstance(entry.activity, Activity)
    assert entry.seconds > 0.0


def test_the_robot_follows_a_timetable_of_anybodys() -> None:
    robot = BareExoskeleton()
    robot.power_on()
    robot.follow(
        [Entry(Activity.STAND, 1.0), Entry(Activity.SIT, 3.0), Entry(Activity.WALK, math.inf, (0.5, 1.2))]
    )
    seen = []
    robot.measured.append(lambda: seen.append(robot.controller.generator.label))
    robot.clock.run_until(8_000_000_000)
    assert list(dict.fromkeys(seen)) == [
        Label.STAND,
        Label.STAND_TO_SIT,
        Label.SIT,
        Label.SIT_TO_STAND,
        Label.WALK,
    ]
    assert robot.controller.dictionary[0x2001, 0].value == 500


def test_a_timetable_from_before_switching_on_loses_nothing() -> None:
    robot = Exoskeleton()
    robot.follow([Entry(Activity.STAND, 3.0), Entry(Activity.WALK)])
    robot.power_on()
    wanted = []
    robot.measured.append(lambda: wanted.append(robot.controller.dictionary.number((0x2005, 0))))
    robot.clock.run_until(4_000_000_000)
    assert wanted.count(int(Activity.STAND)) == pytest.approx(300, abs=2)
    assert wanted[-1] == Activity.WALK


def test_a_robot_whose_controller_was_reset_goes_on_with_its_scenario() -> None:
    robot = Exoskeleton(Scenario.STAIRS_UP)
    robot.power_on()
    robot.clock.run_until(1_000_000_000)
    robot.controller.power_off()
    robot.controller.power_on()
    robot.clock.run_until(4_000_000_000)
    assert robot.controller.controller_state is ControllerState.RUNNING
    assert robot.controller.generator.label is Label.STAIRS_UP


def test_another_person_lives_the_same_day_differently() -> None:
    def lived(person: int) -> list[float]:
        robot = BareExoskeleton(Scenario.WALK, person=person)
        robot.power_on()
        robot.clock.run_until(1_500_000_000)
        return [drive.joint.position for drive in robot.drives.values()]

    assert lived(2) != lived(3)
