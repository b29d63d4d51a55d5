"""The IMU formats on serial ports by name: their parser, and how their device lays its axes and angles."""

from collections.abc import Callable
from dataclasses import dataclass

from drivers.clock import ClockSpec
from drivers.imu import bno08x_rvc, rotation, vectornav, xsens
from drivers.imu.bno08x_rvc import Bno08xRvcParser
from drivers.imu.frame import ImuFrame
from drivers.imu.rotation import Quaternion
from drivers.imu.settings import Axis
from drivers.imu.vectornav import VectornavParser
from drivers.imu.witmotion import WitmotionParser
from drivers.imu.xsens import XsensParser
from drivers.parsing import Parser


@dataclass(frozen=True, slots=True)
class Conventions:
    """How a device lays its axes and angles.

    `axes` are the sensor's axes along the trunk's x (forward), y (left) and z (up) when it is mounted as its
    maker means it; `angles` makes the orientation (sensor to the device's world) of its roll, pitch and yaw.
    """

    axes: tuple[Axis, Axis, Axis] = ("x", "y", "z")
    angles: Callable[[float, float, float], Quaternion] = rotation.from_yaw_pitch_roll


@dataclass(frozen=True, slots=True)
class ImuFormat:
    """One device's language."""

    make_parser: Callable[[], Parser[ImuFrame]]
    clock: ClockSpec | None = None  # of the frames' ticks
    conventions: Conventions = Conventions()


FORMATS: dict[str, ImuFormat] = {
    "witmotion": ImuFormat(WitmotionParser),
    "bno08x-rvc": ImuFormat(Bno08xRvcParser, bno08x_rvc.CLOCK, Conventions(angles=bno08x_rvc.from_angles)),
    "xsens": ImuFormat(XsensParser, xsens.CLOCK),
    "vectornav": ImuFormat(VectornavParser, vectornav.CLOCK, Conventions(axes=("x", "-y", "-z"))),
}
