"""The analysis finds what the simulator's joint is made of, within what docs/how-to/test-a-joint.md says."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from gateway.joint_test.motion import JointTestKind, Wish
from hil_sim.drive.mechanics import JointConstants
from server_gui.core.joint_tests.friction import friction
from server_gui.core.joint_tests.measures import JointTestResult
from server_gui.core.joint_tests.relay import relay
from server_gui.core.joint_tests.response import frequency_response, measured
from server_gui.core.joint_tests.step import step_response
from tests.unit.hil_sim.bench import Bench
from tests.unit.joint_tests.truth import made, recorded, sampled

CONSTANTS = JointConstants()
EFFICIENCY = CONSTANTS.gear_efficiency  # what the gear loses is seen as friction where torque is measured
CURRENT_S = 0.0035  # until the current is there
FRICTION = Wish(JointTestKind.FRICTION, amplitude=math.radians(8.0), speed=math.radians(20.0))
CHIRP = Wish(
    JointTestKind.CHIRP, math.radians(1.0), math.radians(15.0), low_hz=0.2, high_hz=15.0, seconds=30.0
)


def value(result: JointTestResult, name: str) -> float:
    found = result.value(name)
    assert found is not None, [one for one in result.measures if one.name == name]
    return found


@pytest.mark.parametrize("factor", [1.0, 2.5])
def test_friction_is_that_of_the_mechanics(factor: float) -> None:
    bench = Bench(0.3)
    bench.joint.friction_factor = factor
    result = friction(recorded(bench, FRICTION))
    seen = factor / (1.0 - factor * (1.0 - EFFICIENCY))
    assert value(result, "coulomb") == pytest.approx(seen * CONSTANTS.coulomb_friction, rel=0.1)
    assert value(result, "viscous") == pytest.approx(seen * CONSTANTS.viscous_friction, rel=0.1)


def test_a_load_is_told_from_friction_and_cogging_from_both() -> None:
    bench = Bench(0.3)
    bench.joint.gravity, bench.joint.cogging, bench.joint.cogging_cycles = 10.0, 0.8, 12 * 100.0
    result = friction(recorded(bench, FRICTION))
    middle = 0.3 + FRICTION.amplitude / 2
    assert value(result, "load_mean") == pytest.approx(10.0 * math.sin(middle), rel=0.1)
    assert value(result, "coulomb") == pytest.approx(CONSTANTS.coulomb_friction / EFFICIENCY, rel=0.15)
    assert value(result, "cogging_order") == 12
    assert value(result, "cogging") == pytest.approx(0.8, rel=0.25)


def test_without_cogging_none_is_found() -> None:
    result = friction(recorded(Bench(0.3), FRICTION))
    assert result.value("cogging") is None


def closed_loop(bench: Bench, hz: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Of the drive's law and the mechanics, linear, as its manual would have it."""
    gains = bench.drive.servo.settings.gains[bench.drive.servo.control]
    filter_s, period, step = bench.drive.servo.settings.velocity_filter_s, 0.01, 0.001
    inertia = CONSTANTS.inertia + bench.joint.rotor_inertia
    s = 2j * math.pi * hz
    current = bench.drive.servo.settings.current_gain
    z = np.exp(s * step)
    lag = current / (z - 1.0 + current)
    plant = lag / (inertia * s**2 + CONSTANTS.viscous_friction * s) * np.exp(-s * step / 2)
    seen = gains.damping * s / (1.0 + filter_s * s)
    ramp = ((1.0 - np.exp(-s * period)) / (s * period)) ** 2  # a straight line a period
    closed: NDArray[np.complex128] = (
        ramp * plant * (gains.stiffness + gains.damping * s) / (1.0 + plant * (gains.stiffness + seen))
    )
    return closed


def test_the_frequency_response_is_that_of_the_law_and_the_mechanics() -> None:
    bench = Bench(0.3)
    bench.joint.constants = JointConstants(coulomb_friction=0.0, gear_efficiency=1.0)
    test = recorded(bench, CHIRP)
    response = measured(test)
    assert response is not None
    known = (response.coherence > 0.8) & (response.hz > 0.5)
    assert known.mean() > 0.8
    ratio = response.closed[known] / closed_loop(bench, response.hz[known])
    assert np.max(np.abs(20 * np.log10(np.abs(ratio)))) < 2.0
    assert np.max(np.abs(np.degrees(np.angle(ratio)))) < 10.0


def second_order(damping: float, hz: float) -> "signal.TransferFunction":
    omega = 2 * math.pi * hz
    return signal.TransferFunction([omega**2], [1.0, 2 * damping * omega, omega**2])


@pytest.mark.parametrize("damping", [0.3, 0.5, 0.7])
def test_a_step_of_a_second_order_is_as_the_textbook_says(damping: float) -> None:
    times = np.arange(0.0, 4.0, 0.01)
    target = np.where(times >= 1.0, 0.02, 0.0)
    _, position, _ = signal.lsim(second_order(damping, 2.0), np.concatenate([target[1:], target[-1:]]), times)
    result = step_response(
        made(sampled(times, target, position), Wish(JointTestKind.STEP, 0.02, 10.0, repeat=1))
    )
    overshoot = 100 * math.exp(-math.pi * damping / math.sqrt(1 - damping**2))
    assert value(result, "overshoot") == pytest.approx(overshoot, abs=1.0)
    rise = (2.16 * damping + 0.60) / (
        2 * math.pi * 2.0
    )  # Dorf and Bishop, Modern Control Systems, for 0.3 … 0.8
    assert value(result, "rise_time") == pytest.approx(rise, rel=0.08)
    settling = 4.0 / (damping * 2 * math.pi * 2.0)
    assert value(result, "settling_2") == pytest.approx(settling, rel=0.3)
    assert value(result, "steady_error") == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("damping", [0.4, 0.7])
def test_bandwidth_and_phase_margin_of_a_second_order(damping: float) -> None:
    times = np.arange(0.0, 60.0, 0.01)
    target = 0.02 * signal.chirp(times, 0.2, 60.0, 15.0, method="logarithmic")
    _, position, _ = signal.lsim(second_order(damping, 2.0), target, times)
    wish = Wish(JointTestKind.CHIRP, 0.02, 10.0, low_hz=0.2, high_hz=15.0, seconds=60.0)
    result = frequency_response(made(sampled(times, target, position), wish))
    squared = 1 - 2 * damping**2
    bandwidth = 2.0 * math.sqrt(squared + math.sqrt(squared**2 + 1))
    margin = math.atan(2 * damping / math.sqrt(math.sqrt(1 + 4 * damping**4) - 2 * damping**2))
    assert value(result, "bandwidth") == pytest.approx(bandwidth, rel=0.05)
    assert value(result, "phase_margin") == pytest.approx(math.degrees(margin), abs=5.0)


@pytest.mark.parametrize("lost", range(9))
def test_the_highest_frequencies_are_seen_however_long_a_test_was(lost: int) -> None:
    times = np.arange(0.0, 30.5 - 0.01 * lost, 0.01)
    target = 0.02 * signal.chirp(times, 0.2, 30.0, 15.0, method="logarithmic")
    position = target + np.random.default_rng(1).normal(0.0, 2e-4, len(times))
    response = measured(
        made(sampled(times, target, position), Wish(JointTestKind.CHIRP, 0.02, 10.0, seconds=30.0))
    )
    assert response is not None
    assert response.coherence[response.hz < 14.0].min() > 0.9


def test_what_is_not_coherent_is_unknown_and_judges_nothing() -> None:
    times = np.arange(0.0, 60.0, 0.01)
    target = 0.02 * signal.chirp(times, 0.2, 60.0, 15.0, method="logarithmic")
    noise = np.random.default_rng(1).normal(0.0, 0.02, len(times))
    wish = Wish(JointTestKind.CHIRP, 0.02, 10.0, low_hz=0.2, high_hz=15.0, seconds=60.0)
    result = frequency_response(made(sampled(times, target, noise), wish))
    assert [result.value(name) for name in ("bandwidth", "phase_margin", "crossover")] == [None] * 3
    assert any("not known" in note for note in result.notes)


def test_a_joint_that_does_not_move_has_no_step_response() -> None:
    times = np.arange(0.0, 4.0, 0.01)
    target = np.where(times >= 1.0, 0.02, 0.0)
    result = step_response(made(sampled(times, target, 0.0 * times), Wish(JointTestKind.STEP, 0.02, 10.0)))
    assert {one.value for one in result.measures} == {None}
    assert all(one.why for one in result.measures)


@pytest.mark.parametrize("damping", [4.0, 12.0])
def test_a_relay_finds_the_ultimate_gain_and_period_of_the_joint(damping: float) -> None:
    """Without Coulomb friction; with the delay of a cycle and the way to each target, which are in it."""
    bench = Bench(0.3)
    bench.joint.constants = JointConstants(
        coulomb_friction=0.0, viscous_friction=damping, gear_efficiency=1.0
    )
    wish = Wish(JointTestKind.RELAY, math.radians(10.0), 1.0, repeat=12, torque=8.0)
    result = relay(recorded(bench, wish))
    inertia = bench.joint.constants.inertia + bench.joint.rotor_inertia
    omega = np.linspace(1.0, 100.0, 20_000)
    s = 1j * omega
    ramp = ((1.0 - np.exp(-s * 0.01)) / (s * 0.01)) ** 2
    loop = ramp * np.exp(-s * (0.01 + CURRENT_S)) / (s * (inertia * s + damping))
    phase = np.unwrap(np.angle(loop))
    at = int(np.argmax(phase < -math.pi))
    assert value(result, "ultimate_period") == pytest.approx(2 * math.pi / omega[at], rel=0.1)
    assert value(result, "ultimate_gain") == pytest.approx(1 / abs(loop[at]), rel=0.2)
    assert {one.source.split(",")[0] for one in result.proposals} == {
        "Tyreus and Luyben",
        "Ziegler and Nichols",
    }
