"""The joint: friction, end stops, slip; the motor's heat and what it leaves of the current."""

import math
import random

import pytest

from hil_sim.drive.mechanics import STEP_S, Joint, JointConstants
from hil_sim.drive.thermal import AMBIENT_C, HOUSING_RISE_C, WINDING_RISE_C, Thermal

CONSTANTS = JointConstants()
INERTIA = 0.8


def joint(position: float = 0.0) -> Joint:
    made = Joint(CONSTANTS, position)
    made.rotor_inertia = INERTIA - CONSTANTS.inertia
    return made


def run(one: Joint, torque: float, seconds: float) -> None:
    for _ in range(round(seconds / STEP_S)):
        one.step(torque)


def test_less_than_friction_moves_nothing_and_a_little_more_does() -> None:
    held, moving = joint(), joint()
    breakaway = CONSTANTS.coulomb_friction / CONSTANTS.gear_efficiency
    run(held, breakaway * 0.99, 1.0)
    run(moving, breakaway * 1.10, 1.0)
    assert (held.position, held.velocity) == (0.0, 0.0)
    assert moving.position > 0.01


@pytest.mark.parametrize("factor", [1.0, 10.0, 1000.0])
def test_friction_brings_to_rest_and_never_turns_the_motion_round(factor: float) -> None:
    one = joint()
    one.friction_factor = factor
    one.velocity = 2.0
    velocities = []
    while one.velocity:
        one.step(0.0)
        velocities.append(one.velocity)
        assert len(velocities) < 2000
    assert velocities == sorted(velocities, reverse=True)
    assert velocities[-1] == 0.0
    before = one.position
    run(one, 0.0, 0.1)
    assert one.position == before


def test_without_friction_torque_is_inertia_times_acceleration() -> None:
    one = Joint(JointConstants(viscous_friction=0.0, coulomb_friction=0.0, gear_efficiency=1.0))
    one.rotor_inertia = INERTIA - CONSTANTS.inertia
    run(one, 4.0, 0.5)
    assert one.velocity == pytest.approx(4.0 / INERTIA * 0.5, rel=1e-6)
    assert one.position == pytest.approx(0.5 * 4.0 / INERTIA * 0.25, rel=0.01)


def test_the_speed_ends_where_friction_takes_the_whole_torque() -> None:
    one = Joint(JointConstants(high_stop=math.inf))
    run(one, 20.0, 3.0)
    left = 20.0 * CONSTANTS.gear_efficiency - CONSTANTS.coulomb_friction
    assert one.velocity == pytest.approx(left / CONSTANTS.viscous_friction, rel=0.01)


@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_an_end_stop_is_stiff_and_gives_little_back(direction: float) -> None:
    stop = CONSTANTS.high_stop if direction > 0 else CONSTANTS.low_stop
    one = joint(stop - direction * 0.05)
    one.velocity = direction * 3.0
    deepest, fastest_back = 0.0, 0.0
    for _ in range(400):
        one.step(direction * 80.0)
        deepest = max(deepest, direction * (one.position - stop))
        fastest_back = max(fastest_back, -direction * one.velocity)
    assert 0.0 < deepest < 0.02
    assert fastest_back < 1.0
    assert direction * (one.position - stop) == pytest.approx(80.0 / CONSTANTS.stop_stiffness, abs=0.001)


def test_energy_never_comes_from_nothing() -> None:
    source = random.Random(1)
    one = joint()
    for _ in range(200):
        one.position, one.velocity = source.uniform(-1.2, 2.4), source.uniform(-6.0, 6.0)
        before = abs(one.velocity)
        one.coast()
        if CONSTANTS.low_stop < one.position < CONSTANTS.high_stop:
            assert abs(one.velocity) <= before


def test_unpowered_the_gear_holds_more_than_it_takes_to_keep_it_moving() -> None:
    one = joint()
    one.load = 8.0
    for _ in range(100):
        one.coast()
    assert one.velocity == 0.0
    one.velocity = -0.1
    for _ in range(300):
        one.coast()
    assert one.velocity < -0.2


def test_a_slip_moves_the_joint_and_leaves_the_motor() -> None:
    one = joint(0.3)
    one.slip(0.05)
    one.slip(-0.02)
    assert one.position == pytest.approx(0.27)
    assert one.motor_position == pytest.approx(0.3)
    one.slip(5.0)
    assert one.position == CONSTANTS.low_stop
    assert one.motor_position == pytest.approx(0.3)


def test_the_winding_warms_fast_and_the_housing_slowly() -> None:
    thermal = Thermal()
    heat(thermal, 1.0, 60.0)
    assert thermal.winding_c - thermal.housing_c == pytest.approx(WINDING_RISE_C, rel=0.06)
    assert thermal.housing_c == pytest.approx(AMBIENT_C + HOUSING_RISE_C * 0.095, abs=0.2)
    heat(thermal, 1.0, 6000.0)
    assert thermal.housing_c == pytest.approx(AMBIENT_C + HOUSING_RISE_C, abs=0.1)
    assert thermal.load <= 1.0


def test_the_peak_current_folds_back_once_i2t_is_used_up() -> None:
    thermal = Thermal()
    seconds = 0.0
    while thermal.peak_share == 1.0:
        heat(thermal, 2.0, 0.01)
        seconds += 0.01
    assert seconds == pytest.approx(-20.0 * math.log(1.0 - 0.9 / 4.0), rel=0.01)
    heat(thermal, 2.0, 2.0)
    assert thermal.peak_share == 0.0
    heat(thermal, 0.5, 60.0)
    assert thermal.peak_share == 1.0


def heat(thermal: Thermal, current: float, seconds: float) -> None:
    for _ in range(round(seconds / 0.01)):
        thermal.advance(current, 0.01, winding_time_s=20.0, housing_time_s=600.0)
