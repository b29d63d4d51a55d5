"""What a drive watches in itself, and what can be done to it from outside."""

import math

import pytest

import eds
from hil_sim.drive import objects as od
from hil_sim.drive.mechanics import Joint, JointConstants
from hil_sim.drive.objects import Objects
from hil_sim.drive.servo import Servo
from hil_sim.drive.settings import Parameters
from hil_sim.node.dictionary import Dictionary
from tests.unit.hil_sim.bench import NODE, Bench
from tests.unit.hil_sim.driving import (
    COUNTS_PER_RADIAN,
    CSP,
    LIMITED,
    POSITION,
    REDUCED,
    TORQUE,
    WARNING,
    cyclic,
    enable_in,
    enable_now_in,
    has,
    move_to,
    position,
    state,
    torque,
    until,
    velocity,
)

VOLTAGE = 1 << 4
FAULT, DISABLED = 0x08, 0x40


def test_a_supply_that_falls_warns_then_faults_and_can_be_reset_once_it_is_back(bench: Bench) -> None:
    enable_in(bench, CSP)
    assert bench.read(0x6079) == 48_000
    bench.drive.supply_v = 39.0
    bench.run(10)
    assert has(bench, WARNING | VOLTAGE)
    bench.drive.supply_v = 30.0
    until(bench, lambda: state(bench) == FAULT)
    assert bench.read(0x603F) == 0x3220
    assert bench.of(0x80 + NODE)[-1][:3] == b"\x20\x32\x05"
    assert not has(bench, VOLTAGE)
    bench.controlword(0x80)
    assert state(bench) == FAULT
    bench.drive.supply_v = 48.0
    bench.controlword(0x00)
    bench.controlword(0x80)
    assert state(bench) == DISABLED
    assert bench.read(0x603F) == 0
    assert bench.of(0x80 + NODE)[-1][:2] == b"\x00\x00"


def test_without_a_supply_a_drive_cannot_be_switched_on(bench: Bench) -> None:
    bench.start()
    bench.drive.supply_v = 0.0
    bench.controlword(0x06)
    assert state(bench) == 0x21
    bench.controlword(0x07)
    until(bench, lambda: state(bench) == FAULT, at_most_ms=20)


def test_too_much_supply_takes_the_power_stage_off_at_once(bench: Bench) -> None:
    enable_in(bench, CSP)
    bench.drive.supply_v = 62.0
    until(bench, lambda: state(bench) == FAULT, at_most_ms=20)
    assert bench.read(0x603F) == 0x3210


def test_a_weak_supply_makes_a_slow_motor() -> None:
    fastest = {}
    for volts in (48.0, 37.0):
        bench = Bench(position=-1.0)
        enable_in(bench, TORQUE)
        bench.drive.supply_v = volts
        bench.write(0x6080, 0, 6000, 4)
        bench.write(0x6071, 0, 2000, 2)
        fastest[volts] = max(_velocity_after(bench, 5) for _ in range(200))
    assert fastest[37.0] / fastest[48.0] == pytest.approx(37.0 / 48.0, abs=0.05)


def _velocity_after(bench: Bench, milliseconds: int) -> int:
    bench.run(milliseconds)
    return velocity(bench)


def test_a_hot_motor_warns_then_faults_and_stays_so_while_it_is_hot(bench: Bench) -> None:
    enable_in(bench, CSP)
    bench.drive.temperature_c = 90.0
    bench.run(10)
    assert has(bench, WARNING)
    assert bench.read(0x2010) == pytest.approx(900, abs=2)
    bench.drive.temperature_c = 101.0
    until(bench, lambda: state(bench) == FAULT)
    assert bench.read(0x603F) == 0x4310
    bench.controlword(0x80)
    assert state(bench) == FAULT
    bench.drive.temperature_c = 60.0
    bench.controlword(0x00)
    bench.controlword(0x80)
    assert state(bench) == DISABLED


def test_the_winding_is_warmer_than_the_housing_under_load(bench: Bench) -> None:
    enable_in(bench, CSP)
    bench.joint.load = 45.0
    bench.run(60_000)
    winding, housing = bench.read(0x2011), bench.read(0x2010)
    assert 150 < winding - housing < 200
    assert bench.read(0x2012) == pytest.approx(950, abs=60)  # 40.0 of 40.0 N·m, by friction and gear


def test_i2t_folds_the_peak_torque_back_to_what_the_motor_bears(bench: Bench) -> None:
    enable_in(bench, TORQUE)
    bench.joint.position = JointConstants().high_stop
    bench.write(0x6071, 0, 2000, 2)
    bench.run(2000)
    assert torque(bench) == pytest.approx(2000, abs=10)
    bench.run(30_000)
    assert torque(bench) == pytest.approx(1000, abs=40)
    assert has(bench, REDUCED | WARNING | LIMITED)
    assert state(bench) == 0x27


def test_a_fault_from_outside_stops_tells_and_can_be_reset(bench: Bench) -> None:
    enable_in(bench, CSP)
    bench.drive.fault(0x7305)
    until(bench, lambda: state(bench) == FAULT)
    assert bench.read(0x603F) == 0x7305
    assert bench.of(0x80 + NODE)[-1][:2] == b"\x05\x73"
    bench.controlword(0x80)
    assert state(bench) == DISABLED


def test_a_drive_that_has_no_power_sees_no_fault(bench: Bench) -> None:
    bench.boot()
    bench.drive.power_off()
    bench.drive.temperature_c = 150.0
    bench.drive.fault(0x2310)
    bench.run(100)
    assert bench.of(0x80 + NODE) == []
    assert bench.drive.power.error_code == 0


def test_an_encoder_that_jumps_pulls_the_joint_away(bench: Bench) -> None:
    enable_in(bench, CSP)
    bench.drive.encoder.offset_counts = 3_000
    bench.drive.advance()
    assert position(bench) == pytest.approx(3_000, abs=300)
    bench.run(1000)
    assert position(bench) == pytest.approx(0, abs=100)
    assert bench.joint.position * COUNTS_PER_RADIAN == pytest.approx(-3_000, abs=100)


def test_a_stuck_encoder_hides_the_motion_and_lets_the_joint_run_away(bench: Bench) -> None:
    enable_in(bench, POSITION)
    bench.drive.encoder.stuck = True
    before = position(bench)
    move_to(bench, 40_000)
    bench.run(700)
    assert (position(bench), velocity(bench)) == (before, 0)
    assert bench.joint.position * COUNTS_PER_RADIAN > 60_000
    until(bench, lambda: state(bench) == FAULT)
    assert bench.read(0x603F) == 0x8611


def test_a_gear_that_slips_leaves_the_joint_behind_unseen(bench: Bench) -> None:
    enable_in(bench, POSITION)
    bench.joint.slip(0.05)
    assert position(bench) == pytest.approx(0, abs=5)
    move_to(bench, 20_000)
    bench.run(1500)
    assert position(bench) == pytest.approx(20_000, abs=100)
    assert bench.joint.position == pytest.approx(20_000 / COUNTS_PER_RADIAN - 0.05, abs=0.002)


def test_dry_bearings_cost_torque() -> None:
    torques = {}
    for factor in (1.0, 3.0):
        bench = Bench()
        enable_in(bench, CSP)
        bench.joint.friction_factor = factor
        cyclic(bench, 60, lambda cycle: cycle * 300)
        torques[factor] = torque(bench)
    assert torques[3.0] == pytest.approx(3.0 * torques[1.0], rel=0.25)


def test_the_torque_limits_hold_in_each_direction_and_show(bench: Bench) -> None:
    enable_in(bench, CSP)
    bench.write(0x60E1, 0, 250, 2)
    for load, most in ((30.0, 2000), (-30.0, -250)):
        bench.joint.load = load
        bench.run(150)
        assert abs(torque(bench)) <= abs(most)
    assert torque(bench) == -250
    assert has(bench, LIMITED)


def test_parameters_count_from_the_moment_they_are_written(bench: Bench) -> None:
    enable_in(bench, POSITION)
    move_to(bench, 100_000)
    bench.run(500)
    bench.write(0x6072, 0, 0, 2)
    bench.run(40)
    assert torque(bench) == 0
    bench.send(0x000, "81 05")
    bench.run(100)
    enable_now_in(bench, POSITION)
    move_to(bench, 0)
    bench.run(200)
    assert torque(bench) < -100


def test_the_shipped_file_and_the_gaps_of_others_agree() -> None:
    """6007h alone has the standard's default, where a file does not have it."""
    own = eds.load(eds.locate("joint_drive.eds", None), NODE)
    for (index, subindex), value in od._OTHERWISE.items():
        variable = own.variable(index, subindex)
        assert variable is not None, f"{index:04X}h:{subindex}"
        assert variable.default == value or (index, subindex) == od.ABORT_CONNECTION_OPTION


@pytest.mark.parametrize("name", ["elmo_gold.dcf", "trinamic_tmcm_1270.eds"])
def test_a_vendors_file_without_all_objects_makes_a_servo_that_holds(name: str) -> None:
    objects = Objects(Dictionary(eds.load(eds.locate(name, None), NODE)))
    servo = Servo(Joint(JointConstants(), 0.2), Parameters(objects))
    servo.run(500, supply_v=48.0)
    assert servo.joint.position == pytest.approx(0.2, abs=math.radians(0.1))
    assert objects.number(od.POSITION_GAIN) == 3000  # theirs of that number mean something else
