"""Profile position: handshake, buffer, changes under way, windows and limits."""

import pytest

from tests.unit.hil_sim.bench import Bench
from tests.unit.hil_sim.driving import (
    BIT_12,
    BIT_13,
    ENABLE,
    HALT,
    IMMEDIATE,
    LIMITED,
    NEW_SETPOINT,
    ON_SETPOINT,
    POSITION,
    REACHED,
    RELATIVE,
    enable_in,
    has,
    move_to,
    position,
    until,
    velocity,
)


def test_a_set_point_may_come_with_the_word_that_enables(bench: Bench) -> None:
    bench.start()
    bench.write(0x6060, 0, POSITION, 1)
    bench.write(0x607A, 0, 20_000, 4)
    for word in (0x06, 0x07, ENABLE | NEW_SETPOINT):
        bench.controlword(word)
    until(bench, lambda: has(bench, REACHED))
    assert position(bench) == pytest.approx(20_000, abs=500)


def test_between_two_set_points_the_joint_stands_still_or_passes_on(bench: Bench) -> None:
    enable_in(bench, POSITION)
    slowest = {}
    for bits in (0, ON_SETPOINT):
        move_to(bench, 0)
        until(bench, lambda: has(bench, REACHED))
        move_to(bench, 40_000)
        move_to(bench, 80_000, bits)
        until(bench, lambda: position(bench) > 30_000)
        slowest[bits] = min(_velocities_until(bench, 50_000))
        until(bench, lambda: has(bench, REACHED))
        assert position(bench) == pytest.approx(80_000, abs=500)
    assert slowest[0] < 5_000
    assert slowest[ON_SETPOINT] > 60_000


def _velocities_until(bench: Bench, end: int) -> list[int]:
    found = []
    while position(bench) < end:
        found.append(velocity(bench))
    return found


def test_only_one_set_point_waits_and_the_next_is_not_acknowledged(bench: Bench) -> None:
    enable_in(bench, POSITION)
    for target in (60_000, 30_000):
        move_to(bench, target)
    assert has(bench, BIT_12)  # the buffer is full
    move_to(bench, -50_000)
    until(bench, lambda: not has(bench, BIT_12))
    until(bench, lambda: has(bench, REACHED))
    bench.run(500)
    assert position(bench) == pytest.approx(30_000, abs=500)


def test_a_change_at_once_empties_the_buffer(bench: Bench) -> None:
    enable_in(bench, POSITION)
    for target in (60_000, 30_000):
        move_to(bench, target)
    move_to(bench, -20_000, IMMEDIATE)
    assert not has(bench, BIT_12)
    until(bench, lambda: has(bench, REACHED))
    bench.run(500)
    assert position(bench) == pytest.approx(-20_000, abs=500)


def test_a_relative_set_point_counts_from_the_one_before_it(bench: Bench) -> None:
    enable_in(bench, POSITION)
    move_to(bench, 20_000)
    move_to(bench, 15_000, RELATIVE)
    bench.run(2500)
    assert position(bench) == pytest.approx(35_000, abs=100)


def test_halt_keeps_the_set_point_and_its_end_goes_on_with_it(bench: Bench) -> None:
    enable_in(bench, POSITION)
    move_to(bench, 80_000)
    bench.run(400)
    bench.controlword(ENABLE | HALT)
    until(bench, lambda: has(bench, REACHED))
    there = position(bench)
    assert there < 60_000
    bench.run(300)
    assert position(bench) == pytest.approx(there, abs=100)
    bench.controlword(ENABLE)
    until(bench, lambda: not has(bench, REACHED))
    until(bench, lambda: has(bench, REACHED))
    assert position(bench) == pytest.approx(80_000, abs=500)


def test_after_a_halt_on_the_current_limit_the_position_loop_is_closed_again(bench: Bench) -> None:
    enable_in(bench, POSITION)
    bench.write(0x605D, 0, 3, 2)
    move_to(bench, 80_000)
    bench.run(400)
    bench.controlword(ENABLE | HALT)
    bench.run(200)
    bench.controlword(ENABLE)
    until(bench, lambda: has(bench, REACHED))
    bench.joint.load = 20.0
    bench.run(2000)
    assert position(bench) == pytest.approx(80_000 - 350, abs=60)  # (20 − 3) / 1.05 N·m by 3000 N·m/rad


def test_the_target_is_reached_when_the_joint_has_dwelt_in_the_window(bench: Bench) -> None:
    enable_in(bench, POSITION)
    bench.write(0x6068, 0, 300, 2)
    move_to(bench, 10_000)
    until(bench, lambda: bench.drive.servo.motion.done)
    assert until(bench, lambda: has(bench, REACHED)) == pytest.approx(300, abs=15)
    bench.joint.load = 60.0  # pulls it out of the window
    until(bench, lambda: not has(bench, REACHED))


def test_limits_of_speed_and_acceleration_hold_whatever_the_profile_asks(bench: Bench) -> None:
    enable_in(bench, POSITION)
    bench.write(0x607F, 0, 30_000, 4)
    bench.write(0x60C5, 0, 100_000, 4)
    move_to(bench, 80_000)
    bench.run(150)
    assert velocity(bench) == pytest.approx(16_000, rel=0.2)
    bench.run(500)
    assert velocity(bench) == pytest.approx(30_000, rel=0.05)


def test_a_target_beyond_the_software_limit_is_clipped_and_shown(bench: Bench) -> None:
    enable_in(bench, POSITION)
    bench.write(0x607D, 1, -8_000, 4)
    move_to(bench, -50_000)
    assert has(bench, LIMITED)
    until(bench, lambda: has(bench, REACHED))
    assert position(bench) == pytest.approx(-8_000, abs=500)
    move_to(bench, 0)
    until(bench, lambda: has(bench, REACHED))
    assert not has(bench, LIMITED)


def test_a_following_error_is_shown_before_it_faults_and_can_be_left_unwatched(bench: Bench) -> None:
    enable_in(bench, POSITION)
    bench.write(0x6065, 0, 1000, 4)
    bench.joint.load = 70.0  # 23 mrad of the stiffness: 1500 counts
    until(bench, lambda: has(bench, BIT_13))
    assert bench.drive.power.enabled
    bench.write(0x6065, 0, -1, 4)
    bench.run(1000)
    assert bench.drive.power.enabled
    assert not has(bench, BIT_13)


def test_a_new_mode_while_it_moves_slows_down_first(bench: Bench) -> None:
    enable_in(bench, POSITION)
    move_to(bench, 100_000)
    bench.run(500)
    before = velocity(bench)
    assert bench.write(0x6060, 0, 4, 1) == "ok"  # profile torque, target 0
    assert bench.read(0x6061) == 4
    bench.write(0x6060, 0, POSITION, 1)
    bench.run(20)
    assert 0 < velocity(bench) < before
    bench.run(500)
    assert velocity(bench) == 0
