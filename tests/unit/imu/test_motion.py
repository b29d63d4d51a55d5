"""Tilt, axes and mounting: leaning forward and to the left are positive, however the sensor is mounted."""

import math

import pytest

from drivers.errors import SettingsError
from drivers.imu import rotation
from drivers.imu.formats import FORMATS
from drivers.imu.frame import ImuFrame
from drivers.imu.motion import UNITS, TrunkMotion
from drivers.imu.settings import Axis, ImuSettings

STANDARD_GRAVITY = 9.80665


def values(frame: ImuFrame, **settings: object) -> dict[str, float | None]:
    motion = TrunkMotion("trunk", ImuSettings(port="-", **settings), FORMATS["witmotion"].conventions)  # type: ignore[arg-type]
    felt = motion.felt(frame, 0)
    return dict(zip((list(UNITS)[index] for index in felt.indices), felt.values, strict=True))


def leaning(forward: float, left: float, yaw: float = 0.0) -> rotation.Quaternion:
    """World from trunk of a trunk that bends forward, then to its left."""
    return rotation.from_yaw_pitch_roll(-left, forward, yaw)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -3.0])
@pytest.mark.parametrize(("forward", "left"), [(0.3, 0.0), (-0.2, 0.0), (0.0, 0.25), (0.0, -0.4), (0.0, 0.0)])
def test_tilt_has_the_sign_of_the_lean_whatever_the_heading(forward: float, left: float, yaw: float) -> None:
    got = values(ImuFrame("q", orientation=leaning(forward, left, yaw)))
    assert got["tilt_forward"] == pytest.approx(forward, abs=1e-9)
    assert got["tilt_side"] == pytest.approx(left, abs=1e-9)


def test_forward_and_side_lean_together() -> None:
    got = values(ImuFrame("q", orientation=leaning(0.3, 0.2)))
    assert got["tilt_forward"] == pytest.approx(0.3, abs=1e-9)
    assert got["tilt_side"] == pytest.approx(math.asin(math.cos(0.3) * math.sin(0.2)), abs=1e-9)


def test_angles_and_quaternion_of_one_posture_agree() -> None:
    by_angles = values(ImuFrame("a", roll_pitch_yaw=(0.1, -0.2, 0.3)))
    by_quaternion = values(ImuFrame("q", orientation=rotation.from_yaw_pitch_roll(0.1, -0.2, 0.3)))
    assert by_angles == pytest.approx(by_quaternion)
    assert by_angles["tilt_forward"] == pytest.approx(-0.2)


@pytest.mark.parametrize(
    "axes", [("x", "y", "z"), ("x", "-y", "-z"), ("y", "-x", "z"), ("z", "x", "y"), ("-z", "y", "x")]
)
def test_axes_undo_the_way_the_sensor_sits(axes: tuple[Axis, Axis, Axis]) -> None:
    trunk_from_sensor = rotation.from_axes(axes)
    world_from_trunk = leaning(0.35, -0.15, yaw=0.7)
    world_from_sensor = rotation.multiply(world_from_trunk, trunk_from_sensor)
    up_in_sensor = rotation.rotate(rotation.conjugate(world_from_sensor), (0.0, 0.0, STANDARD_GRAVITY))
    got = values(ImuFrame("q", orientation=world_from_sensor, acceleration=up_in_sensor), axes=axes)
    plain = values(ImuFrame("q", orientation=world_from_trunk))
    for quantity in ("tilt_forward", "tilt_side", "orientation_w", "orientation_z"):
        assert got[quantity] == pytest.approx(plain[quantity])
    # Leaning forward, the trunk's x points down: the specific force (up) has a part backwards.
    acceleration_x = got["acceleration_x"]
    assert acceleration_x is not None
    assert acceleration_x == pytest.approx(-STANDARD_GRAVITY * math.sin(0.35))


def test_mounting_turns_what_the_axes_leave() -> None:
    mounting = (0.05, -0.1, 0.2)
    trunk_from_sensor = rotation.from_yaw_pitch_roll(*mounting)
    world_from_sensor = rotation.multiply(leaning(0.2, 0.1), trunk_from_sensor)
    got = values(ImuFrame("q", orientation=world_from_sensor), mounting=mounting)
    assert got["tilt_forward"] == pytest.approx(0.2)


def test_tilt_does_not_jump_when_lying_on_the_side() -> None:
    tilts = [values(ImuFrame("q", orientation=leaning(0.01, left))) for left in (1.56, 1.5708, 1.58)]
    assert all(abs(got["tilt_forward"] or 0.0) < 0.02 for got in tilts)


def test_wrong_axes_name_the_table_they_stand_in() -> None:
    with pytest.raises(SettingsError, match=r"\[imu.trunk\].*right-handed"):
        values(ImuFrame("x"), axes=("x", "y", "-z"))


def test_only_what_a_frame_carries_is_given() -> None:
    assert values(ImuFrame("x")) == {}
    assert values(ImuFrame("x", temperature=21.5)) == {"temperature": 21.5}
    assert values(ImuFrame("x", orientation=(0.0, 0.0, 0.0, 0.0))) == {}
