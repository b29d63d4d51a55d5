"""Settings of an IMU: the table `[imu.NAME]` of the robot's file, by its wiring."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import msgspec

from drivers.bus.settings import Angle, CobId, LongSeconds, NodeId, NodeTimes, Seconds
from drivers.folder import not_a_format
from drivers.imu import can, canopen, formats

if TYPE_CHECKING:
    from drivers.folder import Folder
    from drivers.imu.format import CanFormat, Format, NodeFormat

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
Axes = Annotated[tuple[Axis, Axis, Axis], msgspec.Meta(examples=[["x", "y", "z"]])]
Attitude = Literal["auto", "device", "filter"]

# The key that only tables of that wiring have → the format of those that name none.
USUAL = {"can_id": "witmotion-can", "node_id": "cia410", "port": "witmotion"}


class MountedSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Mounting of an IMU on the trunk, for every wiring.

    `axes` are the sensor's axes along the trunk's x (forward), y (left) and z (up); `mounting` is the
    remaining rotation: roll, pitch, yaw (rad) of the sensor in the trunk.
    """

    axes: Axes | None = None  # sensor axes along forward, left and up; None: the device's own
    mounting: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)  # remaining roll, pitch, yaw (rad)
    zero: str | None = None  # file of `gwrms calibrate imu`, beside this one
    stale_after_s: LongSeconds = 0.5  # silence after which its values are `null`
    lost_after_s: LongSeconds = 2.0  # silence after which it is lost
    format: str  # of its messages

    def __post_init__(self) -> None:
        if not any(self.format in wiring.formats for wiring in WIRINGS):
            raise ValueError(not_a_format(self.format, [name for one in WIRINGS for name in one.formats]))


class ImuSettings(MountedSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One IMU on a serial port."""

    port: str  # a stable path: /dev/serial/by-id/…
    baudrate: Annotated[int, msgspec.Meta(gt=0)] = 115200  # of the serial line
    format: str = USUAL["port"]  # of its messages; `gwrms sensor PORT` finds it
    attitude: Attitude = (
        "auto"  # source of the tilt; auto: the device, else a filter of rates and acceleration
    )


class CanImuSettings(MountedSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One IMU on a CAN bus that sends frames of its own."""

    bus: str  # NAME of its `[can.NAME]` table
    can_id: CobId  # of its frames; extended if above 7FFh
    format: str = USUAL["can_id"]  # of its frames
    attitude: Attitude = (
        "auto"  # source of the tilt; auto: the device, else a filter of rates and acceleration
    )


class NodeImuSettings(MountedSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One IMU that is a CANopen device."""

    bus: str  # NAME of its `[can.NAME]` table
    node_id: NodeId  # its CANopen node id
    format: str = USUAL["node_id"]  # of the device
    eds: str = "inclinometer.eds"  # its EDS file; the vendor's own is better
    sdo_timeout_s: Seconds = 0.5  # time-out of an SDO answer
    heartbeat_timeout_s: Seconds | None = None  # None: 2.5 times the device's 1017h

    @property
    def times(self) -> NodeTimes:
        """The time-outs of its node."""
        return NodeTimes(sdo_timeout_s=self.sdo_timeout_s, heartbeat_timeout_s=self.heartbeat_timeout_s)


class Wiring(NamedTuple):
    """The common part of IMUs with one kind of wiring."""

    formats: "Folder[Format] | Folder[CanFormat] | Folder[NodeFormat]"
    settings: type[MountedSettings]


SERIAL = Wiring(formats.FORMATS, ImuSettings)
WIRINGS = (SERIAL, Wiring(can.FORMATS, CanImuSettings), Wiring(canopen.FORMATS, NodeImuSettings))


def wiring_of(format_name: str) -> Wiring:
    """Return the wiring of a format; serial for an unknown one."""
    return next((wiring for wiring in WIRINGS if format_name in wiring.formats), SERIAL)


def kind_of(table: Mapping[str, Any]) -> type[MountedSettings]:
    """Return the settings for a table `[imu.NAME]`: by its `format`, else by a key that only they have.

    A format's own settings are imported only if the table has more keys than its wiring.
    """
    name = table.get("format") or next(usual for key, usual in USUAL.items() if key in (*table, "port"))
    formats_there, settings = wiring_of(str(name))
    if set(table) <= set(settings.__struct_fields__) or name not in formats_there:
        return settings
    return formats_there[name].settings
