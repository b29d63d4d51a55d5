"""From an IMU's frames to what the trunk does: the sensor's axes become the trunk's, angles become tilt."""

import math

from drivers.errors import SettingsError
from drivers.imu import rotation
from drivers.imu.formats import ImuFormat
from drivers.imu.frame import ImuFrame
from drivers.imu.rotation import Quaternion, Vector
from drivers.imu.settings import ImuSettings
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

Values = tuple[tuple[int, ...], tuple[float | None, ...]]


def channels(name: str) -> tuple[Channel, ...]:
    """The channels of the IMU `name`."""
    return tuple(Channel(f"{name}.{quantity}", name, quantity, unit) for quantity, unit in UNITS.items())


def tilt(up: Vector) -> tuple[float, float]:
    """Tilt of the trunk (forward, side; rad, −π/2 to π/2) from the world's up in the trunk's axes.

    Forward is positive when the trunk leans forward, side when it leans to its left. Each is the angle of
    the trunk's own x or y axis against the horizontal, so that neither jumps at any posture.
    """
    x, y, z = up
    return math.atan2(-x, math.hypot(y, z)), math.atan2(-y, math.hypot(x, z))


class TrunkMotion:
    """Turns frames in the sensor's axes into values of the trunk's channels.

    Trunk axes are those of REP-103: x forward, y left, z up.

    Raises:
        SettingsError: the configured axes are no right-handed frame.

    """

    def __init__(self, name: str, settings: ImuSettings, imu_format: ImuFormat) -> None:
        self._format = imu_format
        try:
            axes = rotation.from_axes(settings.axes or imu_format.axes)
        except ValueError as error:
            raise SettingsError(f"[imu.{name}]: {error}") from error
        trunk_from_sensor = rotation.multiply(rotation.from_yaw_pitch_roll(*settings.mounting), axes)
        self._turn = rotation.matrix(trunk_from_sensor)
        self._sensor_from_trunk = rotation.conjugate(trunk_from_sensor)

    def values(self, frame: ImuFrame) -> Values:
        """Channel indices and values that `frame` gives."""
        indices: list[int] = []
        values: list[float | None] = []
        for where, vector in (
            (ACCELERATION, frame.acceleration),
            (ANGULAR_VELOCITY, frame.angular_velocity),
        ):
            if vector is not None:
                indices += where
                values += rotation.transform(self._turn, vector)
        orientation = self._orientation(frame)
        if orientation is not None:
            indices += (*TILT, *ORIENTATION)
            # The last row of world_from_trunk is the world's up in the trunk's axes.
            values += (*tilt(rotation.matrix(orientation)[2]), *orientation)
        if frame.temperature is not None:
            indices += TEMPERATURE
            values.append(frame.temperature)
        return tuple(indices), tuple(values)

    def _orientation(self, frame: ImuFrame) -> Quaternion | None:
        """Trunk to a world whose z points up."""
        device = frame.orientation
        if device is not None:
            device = rotation.normalised(device)
        elif frame.roll_pitch_yaw is not None:
            device = self._format.angles(*frame.roll_pitch_yaw)
        if device is None:
            return None
        if frame.z_down:
            device = rotation.multiply(NWU_FROM_NED, device)
        return rotation.multiply(device, self._sensor_from_trunk)
