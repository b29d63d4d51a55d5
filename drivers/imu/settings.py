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
    """How an IMU sits on the trunk, whatever it is wired to.

    `axes` says which sensor axis points along the trunk's x (forward), y (left) and z (up). `mounting` turns
    what is left after that: roll, pitch, yaw (rad) of the sensor in the trunk.
    """

    axes: Axes | None = None  # None: as the format's device defines its own
    mounting: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    zero: str | None = None  # file of a zero taken by `gwrms calibrate imu`, beside the robot's file
    stale_after_s: LongSeconds = 0.5
    lost_after_s: LongSeconds = 2.0
    format: str  # how it talks

    def __post_init__(self) -> None:
        if not any(self.format in wiring.formats for wiring in WIRINGS):
            raise ValueError(not_a_format(self.format, [name for one in WIRINGS for name in one.formats]))


class ImuSettings(MountedSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One IMU on a serial port."""

    port: str  # a stable path: /dev/serial/by-id/…
    baudrate: Annotated[int, msgspec.Meta(gt=0)] = 115200
    format: str = USUAL["port"]
    attitude: Attitude = "auto"  # auto: the device's, else from rates and acceleration


class CanImuSettings(MountedSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One IMU on a CAN bus that sends frames of its own."""

    bus: str
    can_id: CobId  # above 7FFh it is an extended one
    format: str = USUAL["can_id"]
    attitude: Attitude = "auto"


class NodeImuSettings(MountedSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One IMU that is a CANopen device."""

    bus: str
    node_id: NodeId
    format: str = USUAL["node_id"]
    eds: str = "inclinometer.eds"  # the vendor's is better
    sdo_timeout_s: Seconds = 0.5
    heartbeat_timeout_s: Seconds | None = None  # None: 2.5 times what the device says in 1017h

    @property
    def times(self) -> NodeTimes:
        """How long its node is waited for."""
        return NodeTimes(sdo_timeout_s=self.sdo_timeout_s, heartbeat_timeout_s=self.heartbeat_timeout_s)


class Wiring(NamedTuple):
    """What IMUs that are wired alike have in common."""

    formats: "Folder[Format] | Folder[CanFormat] | Folder[NodeFormat]"
    settings: type[MountedSettings]


SERIAL = Wiring(formats.FORMATS, ImuSettings)
WIRINGS = (SERIAL, Wiring(can.FORMATS, CanImuSettings), Wiring(canopen.FORMATS, NodeImuSettings))


def wiring_of(format_name: str) -> Wiring:
    """How devices of that language are wired; a serial one where nobody speaks it."""
    return next((wiring for wiring in WIRINGS if format_name in wiring.formats), SERIAL)


def kind_of(table: Mapping[str, Any]) -> type[MountedSettings]:
    """Which settings a table `[imu.NAME]` means: by its `format`, else by the key that only they have.

    A format's own settings are looked up, which imports it, only where the table says more than its wiring.
    """
    name = table.get("format") or next(usual for key, usual in USUAL.items() if key in (*table, "port"))
    formats_there, settings = wiring_of(str(name))
    if set(table) <= set(settings.__struct_fields__) or name not in formats_there:
        return settings
    return formats_there[name].settings
