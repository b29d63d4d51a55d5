"""Makers' conventions for IMU axes and angles."""

from collections.abc import Callable
from dataclasses import dataclass

from drivers.imu import rotation
from drivers.imu.rotation import Quaternion
from drivers.imu.settings import Axis


@dataclass(frozen=True, slots=True)
class Conventions:
    """A device's conventions for axes and angles.

    `axes` are the sensor's axes along the trunk's x (forward), y (left) and z (up) when it is mounted as its
    maker means it; `angles` makes the orientation (sensor to the device's world) of its roll, pitch and yaw.
    """

    axes: tuple[Axis, Axis, Axis] = ("x", "y", "z")
    angles: Callable[[float, float, float], Quaternion] = rotation.from_yaw_pitch_roll


USUAL = Conventions()
