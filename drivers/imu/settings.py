"""What an integrator says about an IMU: the table `[imu.NAME]` of the robot's file."""

from typing import Annotated, Literal

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0)]
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]


class ImuSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One IMU on the trunk.

    `axes` says which sensor axis points along the trunk's x (forward), y (left) and z (up). `mounting` turns
    what is left after that: roll, pitch, yaw (rad) of the sensor in the trunk.
    """

    port: str  # a stable path: /dev/serial/by-id/…
    baudrate: Annotated[int, msgspec.Meta(gt=0)] = 115200
    format: Literal["witmotion", "bno08x-rvc", "xsens", "vectornav"] = "witmotion"
    axes: tuple[Axis, Axis, Axis] | None = None  # None: as the format's device defines its own
    mounting: tuple[float, float, float] = (0.0, 0.0, 0.0)
    zero: str | None = None  # file of a zero taken by `gwrms calibrate imu`, beside the robot's file
    attitude: Literal["auto", "device", "filter"] = (
        "auto"  # auto: the device's, else from rates and acceleration
    )
    stale_after_s: Positive = 0.5
    lost_after_s: Positive = 2.0
