"""The IMU formats by name: their parser, and how their device lays its axes, angles and world."""

from collections.abc import Callable
from dataclasses import dataclass

from drivers.imu import rotation
from drivers.imu.frame import ImuFrame
from drivers.imu.rotation import Quaternion
from drivers.imu.settings import Axis
from drivers.imu.witmotion import WitmotionParser
from drivers.parsing import Parser


@dataclass(frozen=True, slots=True)
class ImuFormat:
    """One device's language and conventions.

    `axes` are the sensor's axes along the trunk's x (forward), y (left) and z (up) when it is mounted as its
    maker means it; `angles` makes the orientation (sensor to the device's world) of its roll, pitch and yaw;
    `world` turns its world into one whose z points up.
    """

    make_parser: Callable[[], Parser[ImuFrame]]
    axes: tuple[Axis, Axis, Axis] = ("x", "y", "z")
    angles: Callable[[float, float, float], Quaternion] = rotation.from_yaw_pitch_roll
    world: Quaternion = rotation.IDENTITY


FORMATS: dict[str, ImuFormat] = {
    "witmotion": ImuFormat(WitmotionParser),
}
