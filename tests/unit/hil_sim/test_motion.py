"""Reference motions: trapezoids, ramps and cyclic interpolation, step by step."""

import math

import pytest

from hil_sim.drive.motion import (
    Hold,
    Motion,
    Profile,
    Reference,
    TorqueRamp,
    TrackPosition,
    TrackTorque,
    TrackVelocity,
    VelocityRamp,
)

DT = 0.001


def run(motion: Motion, reference: Reference, seconds: float) -> list[Reference]:
    steps = []
    for _ in range(round(seconds / DT)):
        motion.step(reference, DT)
        steps.append(Reference(reference.position, reference.velocity, reference.torque))
    return steps


@pytest.mark.parametrize("target", [2.0, -2.0, 0.05, -0.001])
@pytest.mark.parametrize("start_velocity", [0.0, 1.0, -1.0])
def test_a_profile_ends_exactly_at_its_target_within_its_limits(target: float, start_velocity: float) -> None:
    profile = Profile(target, velocity=1.5, acceleration=4.0, deceleration=8.0)
    steps = run(profile, Reference(0.0, start_velocity), 4.0)
    assert profile.done
    assert (steps[-1].position, steps[-1].velocity) == (target, 0.0)
    assert max(abs(step.velocity) for step in steps) <= 1.5 + 1e-9


def test_a_profile_takes_the_time_of_its_trapezoid() -> None:
    profile = Profile(1.0, velocity=1.0, acceleration=4.0, deceleration=4.0)
    reference, steps = Reference(), 0
    while not profile.done:
        profile.step(reference, DT)
        steps += 1
    assert steps * DT == pytest.approx(1.0 + 1.0 / 4.0, abs=0.03)


def test_a_profile_that_passes_through_keeps_its_speed() -> None:
    profile = Profile(1.0, velocity=1.0, acceleration=4.0, deceleration=4.0)
    profile.through = True
    steps = run(profile, Reference(), 2.0)
    assert profile.done
    assert steps[-1].velocity == 1.0
    assert steps[-1].position > 1.5


def test_a_velocity_ramp_speeds_up_and_slows_down_by_different_rates() -> None:
    ramp = VelocityRamp(1.0, acceleration=2.0, deceleration=4.0)
    reference = Reference(0.0, -1.0)
    assert run(ramp, reference, 0.25)[-1].velocity == pytest.approx(0.0, abs=0.01)  # slowing down
    assert not ramp.done
    assert run(ramp, reference, 0.25)[-1].velocity == pytest.approx(0.5, abs=0.01)
    run(ramp, reference, 0.3)
    assert ramp.done
    assert reference.velocity == 1.0


def test_a_ramp_without_a_rate_limit_is_there_at_once() -> None:
    ramp, reference = VelocityRamp(0.0, math.inf, math.inf), Reference(0.0, 2.0)
    ramp.step(reference, DT)
    assert ramp.done
    assert (reference.position, reference.velocity) == (0.0, 0.0)


def test_a_torque_ramp_goes_by_its_slope_and_takes_a_new_aim() -> None:
    ramp, reference = TorqueRamp(), Reference()
    ramp.aim(5.0, slope=10.0)
    assert run(ramp, reference, 0.25)[-1].torque == pytest.approx(2.5, abs=0.02)
    run(ramp, reference, 0.3)
    assert ramp.done
    ramp.aim(5.0, slope=10.0)
    assert ramp.done
    ramp.aim(0.0, slope=10.0)
    assert not ramp.done


@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.010])
@pytest.mark.parametrize(
    ("kind", "quantity"),
    [(TrackPosition, "position"), (TrackVelocity, "velocity"), (TrackTorque, "torque")],
)
def test_a_cyclic_target_is_reached_in_equal_steps_at_the_end_of_the_period(
    kind: type[TrackPosition | TrackVelocity | TrackTorque], quantity: str, period_s: float
) -> None:
    track = kind(3.0, period_s)
    seen = [getattr(step, quantity) for step in run(track, Reference(), period_s)]
    count = round(period_s / DT)
    assert seen == pytest.approx([3.0 * number / count for number in range(1, count + 1)])
    assert track.done


def test_after_the_period_a_position_is_held_and_a_velocity_kept() -> None:
    position, velocity = Reference(), Reference()
    run(TrackPosition(3.0, 0.01), position, 0.05)
    run(TrackVelocity(3.0, 0.01), velocity, 0.05)
    assert (position.position, position.velocity) == (3.0, 0.0)
    assert velocity.velocity == 3.0


def test_hold_stays() -> None:
    reference = Reference(1.0, 2.0)
    run(Hold(), reference, 0.1)
    assert (reference.position, reference.velocity) == (1.0, 0.0)
