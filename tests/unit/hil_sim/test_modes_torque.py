"""Profile torque and cyclic synchronous torque."""

import pytest

from tests.unit.hil_sim.bench import Bench
from tests.unit.hil_sim.driving import (
    CST,
    ENABLE,
    HALT,
    LIMITED,
    REACHED,
    TORQUE,
    cyclic,
    enable_in,
    has,
    map_target,
    torque,
    until,
    velocity,
)


def test_the_torque_rises_by_its_slope(bench: Bench) -> None:
    enable_in(bench, TORQUE)
    bench.joint.load = 20.0
    bench.write(0x6087, 0, 1000, 4)  # per mille of 40 N·m in a second
    bench.write(0x6071, 0, 500, 2)
    bench.run(250)
    assert torque(bench) == pytest.approx(250, abs=25)
    assert bench.read(0x6074, signed=True) == pytest.approx(250, abs=25)
    until(bench, lambda: has(bench, REACHED))
    assert torque(bench) == pytest.approx(500, abs=10)


def test_what_is_less_than_friction_moves_nothing_and_more_moves_it(bench: Bench) -> None:
    enable_in(bench, TORQUE)
    bench.write(0x6071, 0, 70, 2)  # 2.8 N·m
    bench.run(500)
    assert velocity(bench) == 0
    bench.write(0x6071, 0, 200, 2)
    bench.run(500)
    assert velocity(bench) > 10_000


def test_halt_takes_the_torque_away_by_its_slope_and_gives_it_back(bench: Bench) -> None:
    enable_in(bench, TORQUE)
    bench.joint.load = 10.0
    bench.write(0x6071, 0, 300, 2)
    until(bench, lambda: has(bench, REACHED))
    bench.controlword(ENABLE | HALT)
    bench.run(75)
    assert 0 < torque(bench) < 250
    until(bench, lambda: has(bench, REACHED))
    assert torque(bench) == pytest.approx(0, abs=15)
    bench.controlword(ENABLE)
    until(bench, lambda: torque(bench) > 290)


def test_a_target_beyond_the_limits_is_clipped_on_either_side(bench: Bench) -> None:
    enable_in(bench, TORQUE)
    bench.write(0x60E0, 0, 400, 2)
    bench.write(0x60E1, 0, 200, 2)
    for target, held in ((900, 400), (-900, -200)):
        bench.joint.load = held * 0.04
        bench.write(0x6071, 0, target, 2)
        bench.run(600)
        assert torque(bench) == pytest.approx(held, abs=5)
        assert has(bench, LIMITED)


def test_the_motors_speed_is_limited_also_in_torque_mode(bench: Bench) -> None:
    enable_in(bench, TORQUE)
    bench.write(0x6080, 0, 500, 4)
    bench.write(0x6071, 0, 1000, 2)
    bench.run(900)
    assert velocity(bench) == pytest.approx(34_133, rel=0.15)
    assert torque(bench) < 500


def test_cyclic_torque_follows_target_and_offset(bench: Bench) -> None:
    bench.start()
    map_target(bench, 0x6071, 16)
    bench.write(0x6060, 0, CST, 1)
    bench.enable()
    bench.joint.load = 20.0
    bench.write(0x60B2, 0, 100, 2)
    cyclic(bench, 30, lambda cycle: min(cycle * 20, 300), size=2)
    assert torque(bench) == pytest.approx(400, abs=10)
