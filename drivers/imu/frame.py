"""What any IMU format gives: one frame, in SI, in the sensor's own axes."""

import msgspec

from drivers.imu.rotation import Quaternion, Vector

More = dict[str, float | int | str]


class ImuFrame(msgspec.Struct, frozen=True):
    """What one frame says; `None` for what it does not carry.

    Axes and the order of the angles are the device's own: `drivers.imu.formats` says what they are.
    """

    kind: str
    acceleration: Vector | None = None  # m/s², specific force: +g upwards at rest
    angular_velocity: Vector | None = None  # rad/s
    roll_pitch_yaw: Vector | None = None  # rad
    orientation: Quaternion | None = None  # sensor to world
    up: Vector | None = None  # the direction of up, of a device that knows no more of its attitude
    z_down: bool = False  # the world of angles and orientation is north-east-down
    magnetic_field: Vector | None = None  # T
    temperature: float | None = None  # °C
    sequence: int | None = None
    ticks: int | None = None  # the device's clock, in its own unit
    late: bool = False  # repeated, or older than a frame before it
    more: More = {}


_PARTS = {
    "acceleration": "xyz",
    "angular_velocity": "xyz",
    "orientation": "wxyz",
    "up": "xyz",
    "magnetic_field": "xyz",
}


def flat(frame: ImuFrame) -> dict[str, object]:
    """What `frame` carries, by the channels' names; angles in rad as `roll`, `pitch`, `yaw`."""
    line: dict[str, object] = {"frame": frame.kind}
    for number in ("sequence", "ticks"):
        if (value := getattr(frame, number)) is not None:
            line[number] = value
    if frame.roll_pitch_yaw is not None:
        line |= zip(("roll", "pitch", "yaw"), frame.roll_pitch_yaw, strict=True)
    for quantity, parts in _PARTS.items():
        vector = getattr(frame, quantity)
        if vector is not None:
            line |= zip((f"{quantity}_{part}" for part in parts), vector, strict=True)
    if frame.temperature is not None:
        line["temperature"] = frame.temperature
    if frame.late:
        line["late"] = True
    return line | frame.more
