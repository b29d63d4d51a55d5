"""The definition of an IMU's format, as FORMAT in a file: on a serial port, a CAN bus, or by CANopen."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from drivers.clock import ClockSpec
from drivers.imu.conventions import USUAL, Conventions
from drivers.imu.frame import ImuFrame
from drivers.imu.settings import CanImuSettings, ImuSettings, NodeImuSettings
from drivers.parsing import Parser

if TYPE_CHECKING:
    from drivers.build_context import BuildContext
    from drivers.imu.trunk import TrunkImu

    Build = Callable[[str, Any, BuildContext], TrunkImu]  # name, settings of its kind, site


# The components are imported by who builds one: they need what is here.


def _on_port(name: str, settings: ImuSettings, site: "BuildContext") -> "TrunkImu":
    from drivers.imu.device import Imu

    return Imu(name, settings, site.folder, site.recognise, site.standstill)


def _on_bus(name: str, settings: CanImuSettings, site: "BuildContext") -> "TrunkImu":
    from drivers.imu.can_device import CanImu

    return CanImu(name, settings, site.buses[settings.bus], site.folder)


@dataclass(frozen=True, slots=True)
class Format:
    """One device's language on a serial port; `gwrms sensor` tries all of them on what it hears."""

    parser: Callable[[], Parser[ImuFrame]]
    clock: ClockSpec | None = None  # of the frames' ticks
    conventions: Conventions = USUAL
    settings: type[ImuSettings] = ImuSettings  # of its table; what it adds has defaults
    build: "Build" = _on_port


@dataclass(frozen=True, slots=True)
class CanFormat:
    """One device's language on a CAN bus, outside of CANopen."""

    decode: Callable[[bytes], ImuFrame | None]  # one payload; None where it is not the device's
    parser: Callable[[], Parser[ImuFrame]]  # of captured payloads
    maker: str  # in words
    conventions: Conventions = USUAL
    settings: type[CanImuSettings] = CanImuSettings
    build: "Build" = _on_bus


@dataclass(frozen=True, slots=True)
class NodeFormat:
    """One CANopen device profile's."""

    build: "Build"
    settings: type[NodeImuSettings] = NodeImuSettings
