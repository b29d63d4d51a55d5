"""Two positions with known angles tell what counts mean, and where they contradict the drive."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.commission import scale
from gateway.commission.axes_of_imu import NAMES, NoAxes, axes
from gateway.commission.scale import HeldPose, Nominal

LOW, HIGH = HeldPose(0.1, 1_000), HeldPose(1.1, 41_000)


@given(
    counts=st.sampled_from([2048.0, 4096.0, 20_000.0]),
    gear=st.floats(1, 300),
    direction=st.sampled_from([1, -1]),
    zero=st.floats(-3, 3),
    angles=st.tuples(st.floats(-1, 0), st.floats(0.3, 2)),
)
def test_the_scale_gives_back_the_angles_it_was_made_of(
    counts: float, gear: float, direction: int, zero: float, angles: tuple[float, float]
) -> None:
    true = scale.Scale(counts, gear, direction, zero)
    held = [HeldPose(angle, round((angle - zero) * direction * counts * gear / math.tau)) for angle in angles]
    found = scale.scale(held[0], held[1], counts, gear)
    assert found.direction == direction
    assert found.zero_offset == pytest.approx(zero, abs=math.tau / counts / gear)
    assert scale.angle(found, held[0].counts) == pytest.approx(angles[0], abs=math.tau / counts / gear)
    assert scale.angle(true, held[1].counts) == pytest.approx(angles[1], abs=math.tau / counts / gear)


@pytest.mark.parametrize(
    ("nominal", "ratio"),
    [
        (Nominal(4096, 40_000 * math.tau / 4096), None),
        (Nominal(4096, 20_000 * math.tau / 4096), 2.0),
        (Nominal(None, 100), None),
        (Nominal(4096, None), None),
    ],
)
def test_a_drive_that_says_otherwise_is_named_by_how_many_times(
    nominal: Nominal, ratio: float | None
) -> None:
    found = scale.disagreement(scale.counts_per_turn(LOW, HIGH), nominal)
    assert found == (None if ratio is None else pytest.approx(ratio))


@pytest.mark.parametrize(("measured", "gear"), [(409_700, 100.0), (-409_600, 100.0), (4096 * 5.3, 5.3)])
def test_a_gear_that_is_nearly_whole_is_whole(measured: float, gear: float) -> None:
    assert scale.gear(measured, 4096) == pytest.approx(gear, abs=1e-2)


@pytest.mark.parametrize(
    ("second", "words"), [(HeldPose(0.15, 41_000), "10°"), (HeldPose(1.1, 1_005), "another joint was moved")]
)
def test_two_positions_that_say_nothing_are_refused(second: HeldPose, words: str) -> None:
    assert words in str(scale.problem(LOW, second))
    assert scale.problem(LOW, HIGH) is None


def _seen(names: tuple[str, str, str], up: tuple[float, float, float]) -> tuple[float, float, float]:
    """A direction in trunk axes, as a sensor that is mounted so has it."""
    found = {"x": 0.0, "y": 0.0, "z": 0.0}
    for name, part in zip(names, up, strict=True):
        found[name[-1]] = -part if name[0] == "-" else part
    return found["x"], found["y"], found["z"]


RIGHT_HANDED = [("x", "y", "z"), ("y", "-x", "z"), ("-z", "y", "x"), ("-x", "-y", "z"), ("z", "x", "y")]


@pytest.mark.parametrize("mounted", RIGHT_HANDED)
def test_three_postures_tell_how_an_imu_is_mounted(mounted: tuple[str, str, str]) -> None:
    lean, slight = math.radians(25), math.radians(3)
    upright = (-math.sin(slight), 0.0, math.cos(slight))
    forward = (-math.sin(lean), 0.0, math.cos(lean))
    left = (-math.sin(slight), -math.sin(lean), math.cos(lean))
    assert axes(*(_seen(mounted, up) for up in (upright, forward, left))) == mounted


@pytest.mark.parametrize(
    ("ups", "words"),
    [
        (((0, 0, 1), (-0.05, 0, 0.99), (0, -0.5, 0.87)), "forward by less than 10°"),
        (((0, 0, 1), (-0.5, 0, 0.87), (0, 0.5, 0.87)), "own left"),
        (((0, 0.7, 0.7), (-0.5, 0.6, 0.6), (0, 0.0, 1.0)), "35°"),
    ],
)
def test_postures_that_do_not_fit_are_named(ups: tuple[tuple[float, float, float], ...], words: str) -> None:
    assert len(NAMES) == 6
    with pytest.raises(NoAxes, match=words):
        axes(*ups)
