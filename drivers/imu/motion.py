"""From an IMU's frames to what the trunk does: the sensor's axes become the trunk's, angles become tilt."""

import math
from collections import deque
from typing import NamedTuple

from drivers.errors import SettingsError
from drivers.imu import rotation
from drivers.imu.attitude import ComplementaryFilter
from drivers.imu.conventions import Conventions
from drivers.imu.frame import ImuFrame
from drivers.imu.rotation import Quaternion, Vector
from drivers.imu.settings import Attitude, MountedSettings
from drivers.samples import Channel

UNITS: dict[str, str] = {
    "tilt_forward": "rad",
    "tilt_side": "rad",
    "acceleration_x": "m/s²",
    "acceleration_y": "m/s²",
    "acceleration_z": "m/s²",
    "angular_velocity_x": "rad/s",
    "angular_velocity_y": "rad/s",
    "angular_velocity_z": "rad/s",
    "orientation_w": "",
    "orientation_x": "",
    "orientation_y": "",
    "orientation_z": "",
    "temperature": "°C",
}
_INDEX = {quantity: index for index, quantity in enumerate(UNITS)}
TILT = (_INDEX["tilt_forward"], _INDEX["tilt_side"])
ACCELERATION = tuple(_INDEX[f"acceleration_{axis}"] for axis in "xyz")
ANGULAR_VELOCITY = tuple(_INDEX[f"angular_velocity_{axis}"] for axis in "xyz")
ORIENTATION = tuple(_INDEX[f"orientation_{axis}"] for axis in "wxyz")
TEMPERATURE = (_INDEX["temperature"],)

NWU_FROM_NED: Quaternion = (0.0, 1.0, 0.0, 0.0)  # north-east-down to north-west-up: half a turn about x

RAW_AFTER_NS = 500_000_000
ZERO_FRAMES = 200  # about a second of the fastest device


def channels(name: str, count: int = len(UNITS)) -> tuple[Channel, ...]:
    """Return the channels of the IMU `name`: all, or the first `count`, tilt before all else."""
    quantities = list(UNITS.items())[:count]
    return tuple(Channel(f"{name}.{quantity}", name, quantity, unit) for quantity, unit in quantities)


def tilt(up: Vector) -> tuple[float, float]:
    """Tilt of the trunk (forward, side; rad, −π/2 to π/2) from the world's up in the trunk's axes.

    Forward is positive when the trunk leans forward, side when it leans to its left. Each is the angle of
    the trunk's own x or y axis against the horizontal, so that neither jumps at any posture.
    """
    x, y, z = up
    return math.atan2(-x, math.hypot(y, z)), math.atan2(-y, math.hypot(x, z))


class Felt(NamedTuple):
    """The trunk's motion in one frame, in trunk axes."""

    indices: tuple[int, ...]  # of the channels that it gives
    values: tuple[float, ...]
    acceleration: Vector | None
    angular_velocity: Vector | None
    up: Vector | None  # the world's up


class TrunkMotion:
    """Turns frames in the sensor's axes into values of the trunk's channels.

    Trunk axes are those of REP-103: x forward, y left, z up.

    Raises:
        SettingsError: the configured axes are no right-handed frame.

    """

    def __init__(
        self,
        name: str,
        settings: MountedSettings,
        conventions: Conventions,
        attitude: Attitude = "auto",
        zero: Quaternion = rotation.IDENTITY,
    ) -> None:
        self._angles = conventions.angles
        self._attitude = attitude
        try:
            axes = rotation.from_axes(settings.axes or conventions.axes)
        except ValueError as error:
            raise SettingsError(f"[imu.{name}]: {error}") from error
        self._mounted_from_sensor = rotation.multiply(rotation.from_yaw_pitch_roll(*settings.mounting), axes)
        self._filter = ComplementaryFilter()
        self.recent: deque[Vector] = deque(maxlen=ZERO_FRAMES)  # up in the sensor's axes, for a zero
        self.set_zero(zero)
        self.restart()

    def set_zero(self, zero: Quaternion) -> None:
        """Count tilt from the posture that `zero` was taken in."""
        self._trunk_from_sensor = rotation.multiply(zero, self._mounted_from_sensor)
        self._turn = rotation.matrix(self._trunk_from_sensor)
        self._sensor_from_trunk = rotation.conjugate(self._trunk_from_sensor)

    def restart(self) -> None:
        """Restart with the stream."""
        self._filter.restart()
        self.recent.clear()
        self._raw_from_ns: int | None = None  # when a device without attitude is known to have none to send

    def felt(self, frame: ImuFrame, stamp_ns: int) -> Felt:
        """Return the trunk's motion from `frame`, taken at `stamp_ns`."""
        indices: tuple[int, ...] = ()
        values: tuple[float, ...] = ()
        acceleration = angular_velocity = up = None
        if frame.acceleration is not None:
            acceleration = rotation.transform(self._turn, frame.acceleration)
            indices, values = ACCELERATION, acceleration
        if frame.angular_velocity is not None:
            angular_velocity = rotation.transform(self._turn, frame.angular_velocity)
            indices, values = indices + ANGULAR_VELOCITY, values + angular_velocity
        sensor = self._world_from_sensor(frame, stamp_ns)
        sensors_up = frame.up if sensor is None else rotation.up(sensor)
        if sensors_up is not None:
            up = rotation.transform(self._turn, sensors_up)
            indices, values = indices + TILT, values + tilt(up)
            self.recent.append(sensors_up)
        if sensor is not None:
            orientation = rotation.multiply(sensor, self._sensor_from_trunk)
            indices, values = indices + ORIENTATION, values + orientation
        if frame.temperature is not None:
            indices, values = indices + TEMPERATURE, (*values, frame.temperature)
        return Felt(indices, values, acceleration, angular_velocity, up)

    def ups_as_mounted(self) -> list[Vector]:
        """Return the world's up in the axes of the trunk without a zero, of the last second or so."""
        mounted = rotation.matrix(self._mounted_from_sensor)
        return [rotation.transform(mounted, up) for up in self.recent]

    def _world_from_sensor(self, frame: ImuFrame, stamp_ns: int) -> Quaternion | None:
        """Sensor to a world whose z points up: the device's own attitude, or the filter's."""
        if self._attitude != "filter":
            if frame.orientation is not None or frame.roll_pitch_yaw is not None:
                return self._device_attitude(frame, stamp_ns)
            if self._raw_from_ns is None:
                self._raw_from_ns = stamp_ns + RAW_AFTER_NS
            if self._attitude == "device" or stamp_ns < self._raw_from_ns:
                return None
        return self._filter.update(stamp_ns, frame.angular_velocity, frame.acceleration)

    def _device_attitude(self, frame: ImuFrame, stamp_ns: int) -> Quaternion | None:
        """Return the device's own attitude: from its quaternion, else from its angles."""
        device: Quaternion | None = None
        if frame.orientation is not None:
            device = rotation.normalised(frame.orientation)
        elif frame.roll_pitch_yaw is not None:
            device = self._angles(*frame.roll_pitch_yaw)
        if device is None:
            return None
        self._raw_from_ns = stamp_ns + RAW_AFTER_NS
        return rotation.multiply(NWU_FROM_NED, device) if frame.z_down else device
