"""What any IMU format gives: one frame, in SI, in the sensor's own axes."""

import msgspec

from drivers.imu.rotation import Quaternion, Vector


class ImuFrame(msgspec.Struct, frozen=True):
    """What one frame says; `None` for what it does not carry.

    Axes, the order of the angles and the world's frame are the device's own: `drivers.imu.formats` says
    what they are.
    """

    kind: str
    acceleration: Vector | None = None  # m/s², specific force: +g upwards at rest
    angular_velocity: Vector | None = None  # rad/s
    roll_pitch_yaw: Vector | None = None  # rad
    orientation: Quaternion | None = None  # sensor to world
    magnetic_field: Vector | None = None  # T
    temperature: float | None = None  # °C
    sequence: int | None = None
    ticks: int | None = None  # the device's clock, in its own unit
    late: bool = False  # repeated, or older than a frame before it
    more: dict[str, float | int | str] = {}
