"""The complementary filter: against what really happened, and against the library imufusion."""

import math
import random
from collections.abc import Iterator
from typing import NamedTuple

import imufusion
import numpy
import pytest

from drivers.imu import rotation
from drivers.imu.attitude import STANDARD_GRAVITY, ComplementaryFilter
from drivers.imu.formats import FORMATS
from drivers.imu.frame import ImuFrame
from drivers.imu.motion import TILT, TrunkMotion, tilt
from drivers.imu.settings import Attitude, ImuSettings

RATE_HZ = 200
STEP_NS = 1_000_000_000 // RATE_HZ


class Moment(NamedTuple):
    """What is true, and what the sensor measures of it."""

    forward: float
    side: float
    rate: rotation.Vector
    acceleration: rotation.Vector


def walking(seconds: float, noise: float = 1.0, bias: float = 0.0) -> Iterator[Moment]:
    """A trunk that nods and sways with each step and is pushed by each heel strike."""
    chance = random.Random(3)

    def attitude(t: float) -> rotation.Quaternion:
        forward = 0.10 + 0.06 * math.sin(2 * math.pi * 1.8 * t)
        side = 0.05 * math.sin(2 * math.pi * 0.9 * t)
        return rotation.from_yaw_pitch_roll(-side, forward, 0.3 * math.sin(0.2 * t))

    for number in range(int(seconds * RATE_HZ)):
        t = number / RATE_HZ
        now, soon = attitude(t), attitude(t + 1e-5)
        turned = rotation.multiply(rotation.conjugate(now), soon)
        rate = [2e5 * part + bias + 0.005 * noise * chance.gauss(0, 1) for part in turned[1:]]
        bounce = 1.5 * math.sin(2 * math.pi * 1.8 * t)
        world = (
            0.8 * math.sin(2 * math.pi * 1.8 * t + 1),
            0.5 * math.sin(5.6 * t),
            STANDARD_GRAVITY + bounce,
        )
        felt = rotation.rotate(rotation.conjugate(now), world)
        a = [part + 0.05 * noise * chance.gauss(0, 1) for part in felt]
        forward, side = tilt(rotation.matrix(now)[2])
        yield Moment(forward, side, (rate[0], rate[1], rate[2]), (a[0], a[1], a[2]))


def tilt_errors(moments: Iterator[Moment], after_s: float) -> list[float]:
    """Largest of both tilts' errors at each moment, in degrees."""
    ours, errors = ComplementaryFilter(), []
    for number, moment in enumerate(moments):
        attitude = ours.update(number * STEP_NS, moment.rate, moment.acceleration)
        if attitude is not None and number > after_s * RATE_HZ:
            forward, side = tilt(rotation.matrix(attitude)[2])
            errors.append(math.degrees(max(abs(forward - moment.forward), abs(side - moment.side))))
    return errors


def test_tilt_while_walking_is_within_a_degree_and_a_half() -> None:
    errors = tilt_errors(walking(60), after_s=5)
    assert len(errors) > 10_000
    assert max(errors) < 1.5
    assert sum(errors) / len(errors) < 0.6


def test_it_is_as_good_as_imufusion_on_the_same_walk() -> None:
    reference, theirs = imufusion.Ahrs(), []
    reference.set_sample_period(1 / RATE_HZ)
    for number, moment in enumerate(walking(60)):
        gyroscope = numpy.degrees(numpy.array(moment.rate))
        felt = numpy.array(moment.acceleration) / STANDARD_GRAVITY
        reference.update_no_magnetometer(gyroscope, felt)
        w, x, y, z = map(float, reference.get_quaternion())
        forward, side = tilt(rotation.matrix((w, x, y, z))[2])
        if number > 5 * RATE_HZ:
            theirs.append(math.degrees(max(abs(forward - moment.forward), abs(side - moment.side))))
    ours = tilt_errors(walking(60), after_s=5)
    assert sum(ours) / len(ours) <= 1.1 * sum(theirs) / len(theirs)


def test_constant_rate_error_leaves_the_documented_error() -> None:
    bias = math.radians(0.2)
    still = (Moment(0.0, 0.0, (bias, bias, bias), (0.0, 0.0, STANDARD_GRAVITY)) for _ in range(30 * RATE_HZ))
    errors = tilt_errors(still, after_s=20)
    assert max(errors) == pytest.approx(0.2 * 2.0, rel=0.1)


def test_first_attitude_is_gravitys() -> None:
    ours = ComplementaryFilter()
    lean = rotation.from_yaw_pitch_roll(0.1, 0.4, 0.0)
    felt = rotation.rotate(rotation.conjugate(lean), (0.0, 0.0, STANDARD_GRAVITY))
    attitude = ours.update(0, (0.0, 0.0, 0.0), felt)
    assert attitude == pytest.approx(lean)


def test_free_fall_says_nothing_about_up() -> None:
    ours = ComplementaryFilter()
    assert ours.update(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.1)) is None
    ours.update(STEP_NS, (0.0, 0.0, 0.0), (0.0, 0.0, STANDARD_GRAVITY))
    upright = ours.update(2 * STEP_NS, (0.0, 0.0, 0.0), (3.0, 0.0, 0.1))
    assert upright == pytest.approx(rotation.IDENTITY)


def test_long_gap_begins_anew_from_gravity() -> None:
    ours = ComplementaryFilter()
    ours.update(0, (0.0, 0.0, 0.0), (0.0, 0.0, STANDARD_GRAVITY))
    lean = rotation.from_yaw_pitch_roll(0.0, 0.5, 0.0)
    felt = rotation.rotate(rotation.conjugate(lean), (0.0, 0.0, STANDARD_GRAVITY))
    assert ours.update(10**9, (0.0, 0.0, 0.0), felt) == pytest.approx(lean)


def motion(attitude: Attitude) -> TrunkMotion:
    return TrunkMotion("trunk", ImuSettings(port="-"), FORMATS["witmotion"].conventions, attitude)


def feed_raw(trunk: TrunkMotion, seconds: float) -> list[float | None]:
    """Tilt forward at each frame with rates of a still, level device that sends no attitude."""
    tilts: list[float | None] = []
    for number in range(int(seconds * RATE_HZ)):
        stamp = number * STEP_NS
        trunk.felt(ImuFrame("a", acceleration=(0.0, 0.0, STANDARD_GRAVITY)), stamp)
        felt = trunk.felt(ImuFrame("r", angular_velocity=(0.0, 0.0, 0.0)), stamp)
        tilts.append(dict(zip(felt.indices, felt.values, strict=True)).get(TILT[0]))
    return tilts


def test_filter_takes_over_only_where_the_device_sends_no_attitude() -> None:
    tilts = feed_raw(motion("auto"), 1.0)
    assert tilts[0] is None
    assert tilts[-1] == pytest.approx(0.0)
    assert set(feed_raw(motion("device"), 1.0)) == {None}
    assert feed_raw(motion("filter"), 1.0)[0] == pytest.approx(0.0)


def test_devices_own_attitude_is_preferred() -> None:
    trunk = motion("auto")
    for number in range(400):
        stamp = number * STEP_NS
        trunk.felt(ImuFrame("q", orientation=rotation.about_y(0.2)), stamp)
        felt = trunk.felt(
            ImuFrame("r", angular_velocity=(0.0, 0.0, 0.0), acceleration=(0.0, 0.0, STANDARD_GRAVITY)), stamp
        )
        assert TILT[0] not in felt.indices
