"""What an integrator says about an IMU: the table `[imu.NAME]` of the robot's file."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import msgspec

from drivers.bus.settings import CobId, NodeId, NodeTimes

Positive = Annotated[float, msgspec.Meta(gt=0)]
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
Attitude = Literal["auto", "device", "filter"]
Sign = Literal[1, -1]


class MountedSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How an IMU sits on the trunk, whatever it is wired to.

    `axes` says which sensor axis points along the trunk's x (forward), y (left) and z (up). `mounting` turns
    what is left after that: roll, pitch, yaw (rad) of the sensor in the trunk.
    """

    axes: tuple[Axis, Axis, Axis] | None = None  # None: as the format's device defines its own
    mounting: tuple[float, float, float] = (0.0, 0.0, 0.0)
    zero: str | None = None  # file of a zero taken by `gwrms calibrate imu`, beside the robot's file
    stale_after_s: Positive = 0.5
    lost_after_s: Positive = 2.0


class ImuSettings(MountedSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One IMU on a serial port."""

    port: str  # a stable path: /dev/serial/by-id/…
    baudrate: Annotated[int, msgspec.Meta(gt=0)] = 115200
    format: Literal["witmotion", "bno08x-rvc", "xsens", "vectornav"] = "witmotion"
    attitude: Attitude = "auto"  # auto: the device's, else from rates and acceleration


class CanImuSettings(MountedSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One IMU on a CAN bus that sends frames of its own."""

    bus: str
    can_id: CobId  # above 7FFh it is an extended one
    format: Literal["witmotion-can"] = "witmotion-can"
    attitude: Attitude = "auto"


class InclinometerSettings(MountedSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One two-axis inclinometer on a CANopen bus (CiA 410)."""

    bus: str
    node_id: NodeId
    format: Literal["cia410"] = "cia410"
    eds: str = "inclinometer.eds"  # the vendor's is better
    directions: tuple[Sign, Sign] = (
        1,
        1,
    )  # of its x and y axis; 1: positive when it points below the horizon
    poll_hz: Annotated[float, msgspec.Meta(ge=0, le=200)] = 20.0  # slopes that no TPDO brings; 0: never
    sdo_timeout_s: Positive = 0.5
    heartbeat_timeout_s: Positive | None = None  # None: 2.5 times what the device says in 1017h

    @property
    def times(self) -> NodeTimes:
        """How long its node is waited for."""
        return NodeTimes(sdo_timeout_s=self.sdo_timeout_s, heartbeat_timeout_s=self.heartbeat_timeout_s)


_BY_FORMAT: dict[str, type[MountedSettings]] = {
    "witmotion-can": CanImuSettings,
    "cia410": InclinometerSettings,
}
_BY_KEY: dict[str, type[MountedSettings]] = {"can_id": CanImuSettings, "node_id": InclinometerSettings}


def kind_of(table: Mapping[str, Any]) -> type[MountedSettings]:
    """Which settings a table `[imu.NAME]` means: by its `format`, else by the key that only they have."""
    if "format" in table:
        return _BY_FORMAT.get(str(table["format"]), ImuSettings)
    return next((kind for key, kind in _BY_KEY.items() if key in table), ImuSettings)
