"""Cyclic synchronous position: interpolation, offsets, feed-forward; and which modes there are."""

from itertools import pairwise

import pytest

from tests.unit.hil_sim.bench import Bench
from tests.unit.hil_sim.driving import (
    BIT_12,
    COUNTS_PER_RADIAN,
    CSP,
    HALT,
    LIMITED,
    REACHED,
    cyclic,
    enable_in,
    has,
    position,
    state,
    torque,
    velocity,
)


def ramp(cycle: int) -> int:
    return cycle * 300  # counts in 10 ms


def test_the_demand_runs_straight_from_target_to_target(bench: Bench) -> None:
    enable_in(bench, CSP)
    cyclic(bench, 20, ramp)
    bench.write(0x607A, 0, ramp(20), 4)
    bench.send(0x080)
    demands = [_demand_after(bench, 1) for _ in range(6)]
    steps = [b - a for a, b in pairwise(demands)]
    assert steps == pytest.approx([steps[0]] * 5, rel=0.001)
    assert 25 < steps[0] * COUNTS_PER_RADIAN < 40  # in 1 ms of the 10


def _demand_after(bench: Bench, milliseconds: int) -> float:
    bench.run(milliseconds)
    bench.drive.advance()
    return bench.drive.servo.reference.position


def test_the_position_offset_shifts_the_target_within_the_software_limits(bench: Bench) -> None:
    enable_in(bench, CSP)
    bench.write(0x60B0, 0, 2_000, 4)
    cyclic(bench, 60, lambda cycle: min(cycle, 40) * 100)
    assert position(bench) == pytest.approx(6_000, abs=100)
    bench.write(0x607D, 2, 5_000, 4)
    cyclic(bench, 60, lambda _: 4_000)
    assert position(bench) == pytest.approx(5_000, abs=100)
    assert has(bench, LIMITED | BIT_12)


def test_feed_forward_of_velocity_takes_the_lag_away(bench: Bench) -> None:
    enable_in(bench, CSP)
    cyclic(bench, 40, ramp)
    with_feed_forward = bench.read(0x60F4, signed=True)
    bench.write(0x2030, 5, 0, 2)
    cyclic(bench, 40, lambda cycle: ramp(cycle + 40))
    without = bench.read(0x60F4, signed=True)
    bench.write(0x60B1, 0, 30_000, 4)  # the master's own: the ramp's counts/s
    cyclic(bench, 40, lambda cycle: ramp(cycle + 80))
    by_the_master = bench.read(0x60F4, signed=True)
    assert without > with_feed_forward + 700
    assert by_the_master == pytest.approx(with_feed_forward, abs=150)


def test_feed_forward_of_torque_carries_a_known_load(bench: Bench) -> None:
    enable_in(bench, CSP)
    bench.joint.load = 20.0
    cyclic(bench, 40, lambda _: 0)
    sagged = position(bench)
    bench.write(0x60B2, 0, 500, 2)
    cyclic(bench, 40, lambda _: 0)
    assert sagged < -250
    assert position(bench) > sagged + 200
    assert torque(bench) > 400


def test_when_targets_stay_away_it_holds_the_last_one(bench: Bench) -> None:
    enable_in(bench, CSP)
    cyclic(bench, 30, ramp)
    bench.run(300)
    assert velocity(bench) == 0
    assert position(bench) == pytest.approx(ramp(29), abs=100)


def test_halt_stops_it_and_the_targets_lead_on_afterwards(bench: Bench) -> None:
    enable_in(bench, CSP)
    cyclic(bench, 10, lambda _: 0)
    bench.controlword(0x0F | HALT)
    for cycle in range(20):
        bench.write(0x607A, 0, cycle * 100, 4)
        bench.send(0x080)
        bench.run(6)
    assert position(bench) == pytest.approx(0, abs=20)
    assert state(bench) == 0x27
    cyclic(bench, 20, lambda cycle: cycle * 100)
    assert position(bench) == pytest.approx(1_900, abs=300)


def test_bit_10_says_nothing_in_cyclic_modes(bench: Bench) -> None:
    enable_in(bench, CSP)
    cyclic(bench, 10, lambda _: 0)
    assert not has(bench, REACHED)


@pytest.mark.parametrize("mode", [1, 3, 4, 6, 8, 9, 10])
def test_each_mode_of_6502h_can_be_chosen_and_is_shown(bench: Bench, mode: int) -> None:
    enable_in(bench, mode)
    assert bench.read(0x6502) >> mode - 1 & 1


@pytest.mark.parametrize("mode", [-128, -1, 2, 5, 7, 11, 127])
def test_a_mode_that_the_drive_has_not_is_refused_and_the_old_one_stays(bench: Bench, mode: int) -> None:
    bench.boot()
    assert bench.write(0x6060, 0, mode, 1) == "06090030"
    assert bench.read(0x6061, signed=True) == CSP
    assert not (mode > 0 and bench.read(0x6502) >> mode - 1 & 1)


def test_mode_0_means_no_change(bench: Bench) -> None:
    bench.boot()
    bench.write(0x6060, 0, 3, 1)
    assert bench.write(0x6060, 0, 0, 1) == "ok"
    assert bench.read(0x6061) == 3
