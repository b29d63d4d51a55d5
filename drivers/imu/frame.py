"""The common result of all IMU formats: one frame, in SI, in the sensor's own axes."""

from collections.abc import Sequence

import msgspec

from drivers.imu.rotation import Quaternion, Vector

More = dict[str, float | int | str]


class ImuFrame(msgspec.Struct, frozen=True):
    """Contents of one frame; `None` for missing ones.

    Axes and the order of the angles are the device's own: the format's `conventions` say what they are.
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


def moments(frames: Sequence[ImuFrame]) -> list[ImuFrame]:
    """Return frames that came together, those of one moment made one.

    A device that tells a moment in several frames sends each kind once: a kind that comes again begins the
    next moment.
    """
    found: list[list[ImuFrame]] = []
    kinds: set[str] = set()
    for frame in frames:
        if not found or frame.kind in kinds:
            found.append([])
            kinds.clear()
        found[-1].append(frame)
        kinds.add(frame.kind)
    return [group[0] if len(group) == 1 else _together(group) for group in found]


def _together(group: list[ImuFrame]) -> ImuFrame:
    """Return one frame with the values of several kinds of frames.

    Where two say the same, the later one counts.
    """
    acceleration = rate = angles = orientation = temperature = None
    z_down = False
    for frame in group:
        acceleration = frame.acceleration or acceleration
        rate = frame.angular_velocity or rate
        angles = frame.roll_pitch_yaw or angles
        orientation = frame.orientation or orientation
        temperature = temperature if frame.temperature is None else frame.temperature
        z_down = z_down or frame.z_down
    return ImuFrame(
        group[0].kind,
        acceleration=acceleration,
        angular_velocity=rate,
        roll_pitch_yaw=angles,
        orientation=orientation,
        z_down=z_down,
        temperature=temperature,
        ticks=group[0].ticks,
    )


_PARTS = {
    "acceleration": "xyz",
    "angular_velocity": "xyz",
    "orientation": "wxyz",
    "up": "xyz",
    "magnetic_field": "xyz",
}


def flat(frame: ImuFrame) -> dict[str, object]:
    """Return the values of `frame` by the channels' names; angles in rad as `roll`, `pitch`, `yaw`."""
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
