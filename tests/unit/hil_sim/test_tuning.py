"""Tuning is felt: gains that are too high oscillate, too low ones lag, a low torque limit lags under load."""

from dataclasses import dataclass
from itertools import pairwise

import pytest

from tests.unit.hil_sim.bench import Bench
from tests.unit.hil_sim.driving import COUNTS_PER_RADIAN, CSP, POSITION, VELOCITY, enable_now_in, move_to

PROPORTIONAL, DAMPING, INTEGRAL = (0x2030, 1, 2), (0x2030, 2, 2), (0x2030, 3, 4)
CURRENT_GAIN, FILTER = (0x2032, 0, 2), (0x2033, 0, 2)


@dataclass(frozen=True)
class Trace:
    """Following error (counts) and torque (N·m) at each millisecond."""

    errors: list[float]
    torques: list[float]

    @property
    def swing(self) -> float:
        """From peak to peak in the last half second (N·m)."""
        return max(self.torques[-500:]) - min(self.torques[-500:])

    @property
    def oscillates(self) -> bool:
        last = self.torques[-500:]
        mean = sum(last) / len(last)
        turns = sum((a < mean) is not (b < mean) for a, b in pairwise(last))
        return self.swing > 40.0 and turns > 10


def tuned(*gains: tuple[tuple[int, int, int], int]) -> Bench:
    bench = Bench()
    bench.start()
    for (index, subindex, size), value in gains:
        assert bench.write(index, subindex, value, size) == "ok"
    return bench


def watch(bench: Bench, milliseconds: int) -> Trace:
    errors, torques = [], []
    for _ in range(milliseconds):
        bench.run(1)
        bench.drive.advance()
        errors.append(bench.drive.servo.following_error * COUNTS_PER_RADIAN)
        torques.append(bench.drive.servo.torque)
    return Trace(errors, torques)


def moved(bench: Bench, load: float = 0.0) -> Trace:
    """A move of 40 000 counts and the rest after it."""
    enable_now_in(bench, POSITION)
    bench.joint.load = load
    move_to(bench, 40_000)
    return watch(bench, 2500)


def test_the_default_gains_follow_closely_and_come_to_rest() -> None:
    trace = moved(tuned())
    assert max(map(abs, trace.errors)) < 400
    assert trace.swing < 0.1


@pytest.mark.parametrize(
    "gains",
    [
        ((PROPORTIONAL, 20_000),),
        ((PROPORTIONAL, 10_000), (DAMPING, 10)),
        ((DAMPING, 1000),),
        ((PROPORTIONAL, 10_000), (FILTER, 30_000)),
        ((INTEGRAL, 200_000), (DAMPING, 20)),
    ],
    ids=["stiffness", "little damping", "much damping", "slow filter", "integral"],
)
def test_a_wrong_gain_oscillates_up_to_the_torque_limit(
    gains: tuple[tuple[tuple[int, int, int], int], ...],
) -> None:
    assert moved(tuned(*gains)).oscillates


def test_stiffness_between_right_and_wrong_overshoots_and_settles() -> None:
    right, stiff = (moved_by_a_jolt(tuned((PROPORTIONAL, gain))) for gain in (3000, 10_000))
    assert min(right.errors) > -100
    assert min(stiff.errors) < -100
    assert stiff.swing < 1.0


def moved_by_a_jolt(bench: Bench) -> Trace:
    """The reference jumps by 600 counts, as a target of a cyclic master does that is too far away."""
    enable_now_in(bench, CSP)
    bench.drive.servo.reference.position += 600 / COUNTS_PER_RADIAN
    return watch(bench, 1000)


def test_a_low_stiffness_sags_under_load_and_integral_action_lifts_it() -> None:
    sagging = moved(tuned((PROPORTIONAL, 300)), load=20.0)
    assert sagging.errors[-1] > 3000
    lifted = moved(tuned((PROPORTIONAL, 300), (INTEGRAL, 2000)), load=20.0)
    assert lifted.errors[-1] < sagging.errors[-1] / 3


def test_integral_action_gives_no_more_than_its_limit() -> None:
    bench = tuned((PROPORTIONAL, 300), (INTEGRAL, 2000), ((0x2030, 4, 2), 100))
    trace = moved(bench, load=20.0)
    helped = 4.0 / 300.0 * COUNTS_PER_RADIAN  # N·m by N·m/rad
    without = moved(tuned((PROPORTIONAL, 300)), load=20.0)
    assert without.errors[-1] - trace.errors[-1] == pytest.approx(helped, rel=0.15)


def test_a_low_torque_limit_lags_under_load_and_a_higher_one_follows() -> None:
    lags = {}
    for limit in (600, 2000):
        bench = tuned(((0x6072, 0, 2), limit), ((0x6066, 0, 2), 60_000))
        lags[limit] = max(moved(bench, load=21.0).errors)
    assert lags[600] > 10 * lags[2000]


def test_a_current_loop_that_corrects_too_much_trips_the_power_stage() -> None:
    bench = tuned((CURRENT_GAIN, 2100))
    trace = moved(bench)
    assert bench.read(0x603F) == 0x2310
    assert bench.drive.power.faulty
    assert trace.torques[-1] == 0.0


@pytest.mark.parametrize(("gain", "oscillates"), [(100, False), (1000, True)])
def test_the_velocity_loop_has_gains_of_its_own(gain: int, oscillates: bool) -> None:
    bench = tuned(((0x2031, 1, 2), gain))
    enable_now_in(bench, VELOCITY)
    bench.write(0x60FF, 0, 20_000, 4)
    assert watch(bench, 1500).oscillates is oscillates


def test_without_integral_action_the_velocity_falls_under_load() -> None:
    velocities = {}
    for integral in (0, 1000):
        bench = tuned(((0x2031, 2, 2), integral))
        enable_now_in(bench, VELOCITY)
        bench.write(0x60FF, 0, 30_000, 4)
        bench.run(500)
        bench.joint.load = 20.0
        bench.run(700)
        velocities[integral] = bench.joint.velocity * COUNTS_PER_RADIAN
    assert velocities[1000] == pytest.approx(30_000, rel=0.05)
    assert velocities[0] < 20_000
