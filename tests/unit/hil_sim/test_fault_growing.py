"""Faults that grow, and falls: what they do to a robot that walks, and that they leave it as it was."""

import math
from pathlib import Path

import pytest

from hil_sim.exoskeleton import Scenario
from hil_sim.faults.injector import Faults
from hil_sim.gait.stumble_and_fall import FallState
from hil_sim.without_bus import BareExoskeleton

SECOND = 1_000_000_000


class Bench:
    """A robot that walks, and its faults."""

    def __init__(self) -> None:
        self.robot = BareExoskeleton(Scenario.WALK, 1)
        self.faults = Faults(self.robot, Path())
        self.robot.power_on()
        self.run(1.0)

    def run(self, seconds: float) -> None:
        self.robot.clock.run_until(self.robot.clock.now_ns + round(seconds * SECOND))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_friction_grows_and_is_as_before_once_it_is_over(bench: Bench) -> None:
    joint = bench.robot.drives["left_knee"].joint
    bench.faults.begin("friction_grows", "left_knee", params={"times_per_s": 2.0})
    bench.run(0.5)
    assert joint.friction_factor == pytest.approx(2.0, abs=0.15)
    bench.faults.clear()
    assert joint.friction_factor == 1.0


def test_encoder_slips_move_the_joint_away_from_what_is_read(bench: Bench) -> None:
    drive = bench.robot.drives["left_knee"]
    bench.faults.begin("encoder_slips", "left_knee", params={"degrees": 2.0, "every_s": 0.1})
    bench.run(0.55)
    assert drive.servo.position - drive.joint.position == pytest.approx(math.radians(10.0), abs=1e-3)
    bench.faults.clear()
    bench.run(0.1)
    assert drive.servo.position == pytest.approx(drive.joint.position, abs=1e-3)


def test_torque_fades_while_the_current_does_not(bench: Bench) -> None:
    servo = bench.robot.drives["left_knee"].servo
    bench.faults.begin("torque_fades", "left_knee", params={"percent_per_s": 100.0})
    bench.run(0.5)
    assert servo.strength == pytest.approx(0.5, abs=0.06)
    bench.faults.clear()
    assert servo.strength == 1.0


def test_oscillation_makes_the_joint_tremble(bench: Bench) -> None:
    drive = bench.robot.drives["left_knee"]
    before = drive.servo.settings.gains
    bench.faults.begin("oscillation", "left_knee", params={"percent_per_s": 300.0})
    bench.run(0.5)
    assert drive.servo.settings.gains != before
    bench.faults.clear()
    assert drive.servo.settings.gains == before


def test_wearer_resists_with_a_moment_that_beats(bench: Bench) -> None:
    bench.faults.begin("wearer_resists", "left_knee", params={"nm_per_s": 50.0, "hertz": 1.0})
    bench.run(0.5)
    assert bench.robot.wearer.resists[1] == pytest.approx(25.0, abs=3.0)
    bench.faults.clear()
    assert not bench.robot.wearer.resists


def test_insole_cells_die_one_after_the_other(bench: Bench) -> None:
    bench.faults.begin("insole_cells_die", "left_insole", params={"every_s": 0.05})
    bench.run(0.5)
    dead = bench.robot.sensors.insole_faults["left_insole"].dead_cells
    assert 8 <= len(dead) <= 10
    assert all(bench.robot.sensors.pressures[0].pascal[cell] == 0.0 for cell in dead)
    bench.faults.clear()
    assert not dead


def test_imu_slips_and_tells_another_tilt(bench: Bench) -> None:
    bench.faults.begin("imu_slips", "trunk", params={"deg_per_s": 20.0})
    bench.run(0.5)
    true = bench.robot.wearer.trunk(bench.robot.clock.now_s).pitch
    told = bench.robot.sensors.motion.angles[1]
    assert told - true == pytest.approx(math.radians(10.0), abs=0.02)


def test_fatigue_impairs_the_left_leg_until_it_is_over(bench: Bench) -> None:
    generator = bench.robot.controller.generator
    before = generator.wearer
    bench.faults.begin("fatigue", params={"percent_per_s": 100.0})
    bench.run(0.5)
    assert 0.4 <= generator.wearer.impairment[0] <= 0.55
    bench.faults.clear()
    assert generator.wearer == before


def falls(bench: Bench, name: str) -> tuple[float, float]:
    """Pitch and roll of the trunk, on the ground."""
    bench.faults.begin(name)
    bench.run(0.95)
    assert bench.robot.controller.generator.fall.state is FallState.LYING
    trunk = bench.robot.wearer.trunk(bench.robot.clock.now_s)
    return trunk.pitch, trunk.roll


def test_fall_sideways_ends_on_a_side(bench: Bench) -> None:
    assert abs(falls(bench, "fall_sideways")[1]) == pytest.approx(1.2, abs=0.05)


def test_fall_backward_ends_on_the_back(bench: Bench) -> None:
    assert falls(bench, "fall_backward")[0] == pytest.approx(-1.2, abs=0.05)


def test_foot_slips_and_bears_less_before_the_fall(bench: Bench) -> None:
    bench.faults.begin("foot_slips")
    bench.run(0.1)
    assert bench.robot.controller.generator.fall.load < 0.7


def test_trip_and_fall_stumbles_first(bench: Bench) -> None:
    bench.faults.begin("trip_and_fall", params={"after_s": 0.2})
    bench.run(0.1)
    assert bench.robot.controller.generator.stumble.active
    bench.run(1.2)
    assert bench.robot.controller.generator.fall.state is FallState.LYING
