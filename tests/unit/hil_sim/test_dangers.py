"""Dangers: each ends in harm by the simulator's own truth, and leaves a healthy robot behind."""

import pytest

from hil_sim.dangerous_course import Course
from hil_sim.dangers import DANGERS
from hil_sim.exoskeleton import Scenario
from hil_sim.faults.registry import FAULTS
from hil_sim.without_bus import BareExoskeleton

SECOND = 1_000_000_000


def course(*names: str) -> tuple[BareExoskeleton, Course]:
    robot = BareExoskeleton(Scenario.STAND, 3, person=2)
    led = Course(robot, 3, 0.0, names)
    robot.power_on()
    return robot, led


def test_there_are_at_least_twelve_dangers_and_each_is_a_fault() -> None:
    assert len([one for one in DANGERS.values() if not one.sudden]) >= 12
    assert {one.fault for one in DANGERS.values()} <= set(FAULTS)
    for danger in DANGERS.values():
        assert set(danger.params) <= set(FAULTS[danger.fault].parameters)
        assert set(danger.on) <= set(FAULTS[danger.fault].on.value)


@pytest.mark.parametrize("name", ["sideways", "torque_off"])
def test_a_danger_does_harm_and_is_over_afterwards(name: str) -> None:
    robot, led = course(name)
    number = 1.0 + list(DANGERS).index(name)
    harmed = False
    for at in range(1, 45):
        robot.clock.run_until(at * SECOND // 2)
        harmed |= led.now == number and led.harmed
        if harmed and led.now == -1.0:
            break
    assert harmed
    assert not led.harmed
