"""A joint drive seen from the bus: states, modes, limits, stops, faults."""

import pytest

from tests.unit.hil_sim.bench import NODE, Bench
from tests.unit.hil_sim.driving import (
    COUNTS_PER_RADIAN,
    IMMEDIATE,
    POSITION,
    RELATIVE,
    enable_in,
    move_to,
    state,
)


def test_the_way_up_is_one_transition_at_a_time(bench: Bench) -> None:
    bench.boot()
    assert state(bench) == 0x40
    for controlword, expected in ((0x0F, 0x40), (0x07, 0x40), (0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        bench.controlword(controlword)
        assert state(bench) == expected


def test_the_shipped_file_has_the_objects_of_sync_and_time_that_the_drive_plays(bench: Bench) -> None:
    bench.boot()
    assert [bench.read(index) for index in (0x1006, 0x1007, 0x1012)] == [0, 0, 0x100]
    assert bench.write(0x1012, 0, 0x8000_0100, 4) == "ok"
    bench.send(0x100, "10 27 00 00 05 00")
    bench.run(5)
    assert bench.node.time_of_day == (10_000, 5)


def test_enabling_does_not_move_the_joint() -> None:
    bench = Bench(position=0.4)
    bench.start()
    bench.enable()
    for _ in range(50):
        bench.send(0x080)
        bench.run(8)
    assert bench.read(0x6064, signed=True) == pytest.approx(0.4 * COUNTS_PER_RADIAN, abs=20)


def test_profile_position_arrives_with_the_profile_velocity(bench: Bench) -> None:
    enable_in(bench, POSITION)
    bench.write(0x6081, 0, 20_000, 4)
    move_to(bench, 30_000)
    bench.run(700)
    assert bench.read(0x606C, signed=True) == pytest.approx(20_000, rel=0.05)
    assert not bench.read(0x6041) & 0x0400
    bench.run(1500)
    assert bench.read(0x6064, signed=True) == pytest.approx(30_000, abs=100)
    assert bench.read(0x6041) & 0x0400


def test_a_new_set_point_is_acknowledged_until_its_bit_falls(bench: Bench) -> None:
    enable_in(bench, POSITION)
    bench.write(0x607A, 0, 10_000, 4)
    assert bench.controlword(0x1F) & 0x1000
    assert not bench.controlword(0x0F) & 0x1000


def test_a_second_set_point_waits_for_the_first_unless_it_is_to_change_at_once(bench: Bench) -> None:
    enable_in(bench, POSITION)
    move_to(bench, 20_000)
    move_to(bench, -10_000)
    assert bench.read(0x6041) & 0x1000
    bench.run(400)
    assert bench.read(0x606C, signed=True) > 0
    bench.run(5000)
    assert bench.read(0x6064, signed=True) == pytest.approx(-10_000, abs=100)
    move_to(bench, 40_000)
    bench.run(300)
    move_to(bench, -10_000, IMMEDIATE)
    bench.run(1000)
    assert bench.read(0x6064, signed=True) < 10_000


def test_relative_moves_and_software_limits(bench: Bench) -> None:
    enable_in(bench, POSITION)
    move_to(bench, 5_000)
    bench.run(1000)
    move_to(bench, 5_000, RELATIVE)
    bench.run(1000)
    assert bench.read(0x6064, signed=True) == pytest.approx(10_000, abs=100)
    bench.write(0x607D, 2, 12_000, 4)
    move_to(bench, 50_000)
    assert bench.read(0x6041) & 0x0800
    bench.run(3000)
    assert bench.read(0x6064, signed=True) == pytest.approx(12_000, abs=100)


def test_a_low_torque_limit_lags_and_then_faults_on_following_error(bench: Bench) -> None:
    enable_in(bench, POSITION)
    assert bench.write(0x6072, 0, 50, 2) == "ok"  # 2 N·m, less than the friction
    move_to(bench, 60_000)
    bench.run(500)
    assert bench.read(0x6077, signed=True) == 50
    assert bench.read(0x60F4, signed=True) > 10_000
    bench.run(1500)
    assert state(bench) == 0x08
    assert bench.read(0x603F) == 0x8611
    assert bench.of(0x80 + NODE)[0][:2] == b"\x11\x86"
    bench.controlword(0x00)
    bench.controlword(0x80)
    assert state(bench) == 0x40


def test_a_load_is_seen_as_torque_and_current(bench: Bench) -> None:
    bench.start()
    bench.enable()
    bench.joint.load = 20.0  # half of the rated 40 N·m
    bench.run(2000)
    held_by_motor = (20.0 - 3.0) / 1.05  # the rest is friction, a twentieth of what the motor gives among it
    assert bench.read(0x6077, signed=True) == pytest.approx(held_by_motor / 0.040, abs=10)
    assert bench.read(0x6078, signed=True) == pytest.approx(held_by_motor / 0.040, abs=10)


def test_heat_follows_torque(bench: Bench) -> None:
    bench.start()
    bench.enable()
    bench.joint.load = 40.0
    bench.run(60_000)
    assert 270 < bench.read(0x2010, signed=True) < 300


def test_without_power_a_heavy_load_moves_the_joint_and_a_light_one_does_not(bench: Bench) -> None:
    bench.boot()
    bench.joint.load = 10.0
    bench.run(1000)
    assert bench.joint.position == 0.0
    bench.joint.load = 25.0
    bench.run(1000)
    assert bench.joint.position < -0.5


def test_cyclic_position_reaches_each_target_within_the_interpolation_time(bench: Bench) -> None:
    bench.start()
    for cycle in range(100):
        controlword = (0x06, 0x07, 0x0F)[min(cycle, 2)]
        target = max(cycle - 20, 0) * 200
        bench.send(0x200 + NODE, (controlword | 8 << 16 | target << 24).to_bytes(7, "little").hex())
        bench.send(0x080)
        bench.run(6)
    assert state(bench) == 0x27
    assert bench.read(0x606C, signed=True) == pytest.approx(20_000, rel=0.05)
    assert bench.read(0x6064, signed=True) == pytest.approx(79 * 200, abs=400)
