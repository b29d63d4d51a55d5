"""Profile velocity and cyclic synchronous velocity."""

import pytest

from tests.unit.hil_sim.bench import Bench
from tests.unit.hil_sim.driving import (
    BIT_12,
    COUNTS_PER_RADIAN,
    CSV,
    LIMITED,
    REACHED,
    VELOCITY,
    cyclic,
    enable_in,
    has,
    map_target,
    position,
    torque,
    until,
    velocity,
)


def test_a_target_velocity_is_reached_by_the_profiles_ramps(bench: Bench) -> None:
    enable_in(bench, VELOCITY)
    bench.write(0x6083, 0, 100_000, 4)
    bench.write(0x6084, 0, 200_000, 4)
    bench.write(0x60FF, 0, 40_000, 4)
    bench.run(200)
    assert velocity(bench) == pytest.approx(20_000, rel=0.1)
    assert bench.read(0x606B, signed=True) == pytest.approx(20_000, rel=0.05)
    until(bench, lambda: has(bench, REACHED))
    assert velocity(bench) == pytest.approx(40_000, abs=2000)
    bench.write(0x60FF, 0, 0, 4)
    bench.run(100)
    assert velocity(bench) == pytest.approx(20_000, rel=0.15)
    until(bench, lambda: has(bench, REACHED | BIT_12))
    assert velocity(bench) == pytest.approx(0, abs=500)


def test_it_turns_round_through_zero(bench: Bench) -> None:
    enable_in(bench, VELOCITY)
    for target in (30_000, -30_000):
        bench.write(0x60FF, 0, target, 4)
        bench.run(20)
        until(bench, lambda: has(bench, REACHED))
        assert velocity(bench) == pytest.approx(target, abs=2000)


def test_a_load_does_not_keep_it_from_its_velocity(bench: Bench) -> None:
    enable_in(bench, VELOCITY)
    bench.write(0x60FF, 0, 20_000, 4)
    bench.run(500)
    bench.joint.load = 25.0
    bench.run(500)
    assert velocity(bench) == pytest.approx(20_000, abs=1000)
    assert torque(bench) > 600


def test_integral_action_does_not_wind_up_while_the_torque_is_limited(bench: Bench) -> None:
    enable_in(bench, VELOCITY)
    bench.joint.load = 60.0
    bench.write(0x6072, 0, 1000, 2)
    bench.write(0x60FF, 0, 20_000, 4)
    bench.run(1000)
    assert velocity(bench) <= 0
    assert has(bench, LIMITED)
    bench.joint.load = 0.0
    bench.run(150)
    fastest = max(_run_and_read(bench) for _ in range(100))
    assert fastest < 45_000
    assert velocity(bench) == pytest.approx(20_000, abs=1000)


def _run_and_read(bench: Bench) -> int:
    bench.run(5)
    return velocity(bench)


@pytest.mark.parametrize("mode", [VELOCITY, CSV])
def test_it_stops_at_the_end_of_the_software_range(bench: Bench, mode: int) -> None:
    bench.start()
    map_target(bench, 0x60FF, 32)
    bench.write(0x6060, 0, mode, 1)
    bench.enable()
    bench.write(0x607D, 2, 30_000, 4)
    cyclic(bench, 120, lambda _: 60_000)
    assert velocity(bench) == pytest.approx(0, abs=500)
    assert position(bench) == pytest.approx(30_000, abs=1500)
    assert has(bench, LIMITED)
    cyclic(bench, 40, lambda _: -60_000)
    assert velocity(bench) < -30_000


def test_max_motor_speed_limits_the_demand(bench: Bench) -> None:
    enable_in(bench, VELOCITY)
    bench.write(0x6080, 0, 300, 4)  # 1/min at the motor: 20 480 counts/s
    bench.write(0x60FF, 0, 60_000, 4)
    bench.run(500)
    assert 17_000 < velocity(bench) <= 20_480
    assert has(bench, LIMITED)


def test_cyclic_velocity_adds_its_offset_and_interpolates(bench: Bench) -> None:
    bench.start()
    map_target(bench, 0x60FF, 32)
    bench.write(0x6060, 0, CSV, 1)
    bench.enable()
    bench.write(0x60B1, 0, 5_000, 4)
    cyclic(bench, 30, lambda cycle: min(cycle, 20) * 1_000)
    assert velocity(bench) == pytest.approx(25_000, rel=0.05)
    cyclic(bench, 1, lambda _: 20_000)
    assert has(bench, BIT_12)


def test_it_moves_only_when_a_target_has_come_after_enabling(bench: Bench) -> None:
    bench.start()
    map_target(bench, 0x60FF, 32)
    bench.write(0x6060, 0, CSV, 1)
    bench.write(0x60FF, 0, 30_000, 4)
    bench.enable()
    for _ in range(20):
        bench.send(0x080)
        bench.run(8)
    assert bench.joint.position * COUNTS_PER_RADIAN == pytest.approx(0.0, abs=1.0)
