"""What a file of an IMU's language defines as FORMAT: on a serial port, on a CAN bus, or a CANopen device."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from drivers.clock import ClockSpec
from drivers.imu import rotation
from drivers.imu.frame import ImuFrame
from drivers.imu.rotation import Quaternion
from drivers.imu.settings import Axis, CanImuSettings, ImuSettings, NodeImuSettings
from drivers.parsing import Parser

if TYPE_CHECKING:
    from drivers.imu.trunk import TrunkImu
    from drivers.site import Site

    Build = Callable[[str, Any, Site], TrunkImu]  # name, settings of its kind, site


@dataclass(frozen=True, slots=True)
class Conventions:
    """How a device lays its axes and angles.

    `axes` are the sensor's axes along the trunk's x (forward), y (left) and z (up) when it is mounted as its
    maker means it; `angles` makes the orientation (sensor to the device's world) of its roll, pitch and yaw.
    """

    axes: tuple[Axis, Axis, Axis] = ("x", "y", "z")
    angles: Callable[[float, float, float], Quaternion] = rotation.from_yaw_pitch_roll


# The components are imported by who builds one: they need what is here.


def _on_port(name: str, settings: ImuSettings, site: "Site") -> "TrunkImu":
    from drivers.imu.device import Imu

    return Imu(name, settings, site.folder)


def _on_bus(name: str, settings: CanImuSettings, site: "Site") -> "TrunkImu":
    from drivers.imu.can_device import CanImu

    return CanImu(name, settings, site.buses[settings.bus], site.folder)


@dataclass(frozen=True, slots=True)
class Format:
    """One device's language on a serial port; `gwrms sensor` tries all of them on what it hears."""

    parser: Callable[[], Parser[ImuFrame]]
    clock: ClockSpec | None = None  # of the frames' ticks
    conventions: Conventions = Conventions()
    settings: type[ImuSettings] = ImuSettings  # of its table; what it adds has defaults
    build: "Build" = _on_port


@dataclass(frozen=True, slots=True)
class CanFormat:
    """One device's language on a CAN bus, outside of CANopen."""

    decode: Callable[[bytes], ImuFrame | None]  # one payload; None where it is not the device's
    parser: Callable[[], Parser[ImuFrame]]  # of captured payloads
    maker: str  # in words
    conventions: Conventions = Conventions()
    settings: type[CanImuSettings] = CanImuSettings
    build: "Build" = _on_bus


@dataclass(frozen=True, slots=True)
class NodeFormat:
    """One CANopen device profile's."""

    build: "Build"
    settings: type[NodeImuSettings] = NodeImuSettings
