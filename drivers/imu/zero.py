"""The zero of a trunk's tilt: the rotation that makes "standing upright now" read zero, and its file."""

import math
from collections.abc import Sequence
from pathlib import Path

import msgspec

from drivers import calibration_file
from drivers.errors import DriverError
from drivers.imu import rotation
from drivers.imu.rotation import Quaternion, Vector

LARGEST = math.radians(45.0)  # more is a wrong `axes`, not a zero
STILL = math.radians(2.0)


class NotUpright(DriverError):
    """The measurement cannot be a zero."""


class Zero(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The rotation (w, x, y, z) from the trunk as mounted to the trunk as it stands upright."""

    rotation: Quaternion
    taken_utc: str = ""

    def __post_init__(self) -> None:
        if abs(math.hypot(*self.rotation) - 1.0) > 1e-3:
            raise ValueError("`rotation` must be a unit quaternion [w, x, y, z]")


def measure(ups: Sequence[Vector]) -> Quaternion:
    """Return the zero from directions of up (unit vectors, trunk axes) of a person upright and still.

    Raises:
        NotUpright: nothing was measured, the trunk moved, or it was further from upright than a mounting is.

    """
    if not ups:
        raise NotUpright("no attitude has come from the IMU: see that it is live, then take the zero again")
    mean = [sum(part) / len(ups) for part in zip(*ups, strict=True)]
    length = math.hypot(*mean)
    x, y, z = (part / length for part in mean)
    widest = max(math.acos(max(-1.0, min(1.0, x * a + y * b + z * c))) for a, b, c in ups)
    if widest > STILL:
        raise NotUpright(
            f"the trunk moved by {math.degrees(widest):.1f}° while the zero was taken: stand still"
        )
    angle = math.acos(max(-1.0, min(1.0, z)))
    if angle > LARGEST:
        raise NotUpright(
            f"the IMU reads {math.degrees(angle):.0f}° from upright: "
            "correct `axes` or `mounting` before you take a zero"
        )
    flat = math.hypot(x, y)
    if flat < 1e-9:
        return rotation.IDENTITY
    sine = math.sin(angle / 2)
    return (math.cos(angle / 2), sine * y / flat, -sine * x / flat, 0.0)


def load(path: Path) -> Quaternion:
    """Return the zero in the file at `path`.

    Raises:
        SettingsError: it cannot be read or is wrong; the message names file and key.

    """
    return calibration_file.load(path, Zero, "IMU zero", "gwrms calibrate imu", "zero").rotation


def text(zero: Quaternion, taken_utc: str) -> str:
    """Return the contents of the file."""
    numbers = ", ".join(f"{part:.9f}" for part in zero)
    return (
        "# The trunk's tilt reads zero in the posture in which this was taken.\n"
        f'taken_utc = "{taken_utc}"\nrotation = [{numbers}]\n'
    )
