"""The complementary filter: attitude from raw rates and acceleration, for devices that send nothing better.

The rates are integrated; where the acceleration is close to g in length, its direction is taken for "up" and
the attitude is turned towards it by dt/τ of the angle between them. So tilt follows the rates at once and
gravity over τ seconds; a constant rate error of b leaves a tilt error of b·τ. Heading has no reference: it
starts at zero and drifts.
"""

import math

from drivers.imu import rotation
from drivers.imu.rotation import IDENTITY, Quaternion, Vector

STANDARD_GRAVITY = 9.80665
TIME_CONSTANT_S = 2.0
TRUSTED = 0.15  # acceleration further from g than this share says nothing about up
LONGEST_STEP_S = 0.2  # after a longer gap the rates in between are unknown: begin anew


class ComplementaryFilter:
    """Attitude of one sensor (sensor to a world whose z points up)."""

    def __init__(self, time_constant_s: float = TIME_CONSTANT_S) -> None:
        self._time_constant_s = time_constant_s
        self.restart()

    def restart(self) -> None:
        """Forget everything: the next acceleration alone gives the first attitude."""
        self._attitude: Quaternion | None = None
        self._acceleration: Vector | None = None
        self._last_ns = 0

    def update(
        self, stamp_ns: int, angular_velocity: Vector | None, acceleration: Vector | None
    ) -> Quaternion | None:
        """Attitude after a frame with rates (rad/s), acceleration (m/s²) or both; `None` without rates."""
        if acceleration is not None:
            self._acceleration = acceleration
        if angular_velocity is None:
            return None
        step_s = (stamp_ns - self._last_ns) / 1e9
        self._last_ns = stamp_ns
        if self._attitude is None or not 0.0 <= step_s <= LONGEST_STEP_S:
            self._attitude = None if self._acceleration is None else _upright(self._acceleration)
            return self._attitude
        turned = rotation.multiply(self._attitude, _turn(angular_velocity, step_s))
        self._attitude = self._corrected(turned, step_s)
        return self._attitude

    def _corrected(self, attitude: Quaternion, step_s: float) -> Quaternion:
        """`attitude` turned towards the measured up, and kept at length 1."""
        if self._acceleration is not None:
            x, y, z = rotation.rotate(attitude, self._acceleration)  # in the world: up, if all is right
            length = math.hypot(x, y, z)
            if abs(length / STANDARD_GRAVITY - 1.0) < TRUSTED:
                angle = math.atan2(math.hypot(x, y), z)
                share = min(1.0, step_s / self._time_constant_s) * angle / (math.hypot(x, y) or 1.0)
                attitude = rotation.multiply(_turn((y * share, -x * share, 0.0), 1.0), attitude)
        return rotation.normalised(attitude) or IDENTITY


def _turn(angular_velocity: Vector, seconds: float) -> Quaternion:
    """Return the rotation of a constant rate over a time."""
    x, y, z = angular_velocity
    rate = math.hypot(x, y, z)
    half = rate * seconds / 2
    scale = math.sin(half) / rate if rate > 0.0 else 0.0
    return (math.cos(half), x * scale, y * scale, z * scale)


def _upright(up: Vector) -> Quaternion | None:
    """Return the attitude without heading in which the sensor measures `up` (any length)."""
    x, y, z = up
    if math.hypot(x, y, z) < 0.1 * STANDARD_GRAVITY:
        return None
    roll = math.atan2(y, z)
    pitch = math.atan2(-x, math.hypot(y, z))
    return rotation.from_yaw_pitch_roll(roll, pitch, 0.0)
