"""A WitMotion IMU on the trunk (WT901 protocol manual): 11-byte frames `55 type d0…d7 sum`.

The sensor's axes are the trunk's: x forward, y left, z up. Angles are roll, pitch, yaw about them, in the
order z, y, x.
"""

import math
import random
import struct

from hil_sim.gait.wearer import GRAVITY, Trunk

ACCELERATION = 0x51  # ÷ 32768 · 16 g, temperature ÷ 100
ANGULAR_RATE = 0x52  # ÷ 32768 · 2000 °/s, temperature ÷ 100
ANGLE = 0x53  # ÷ 32768 · 180°, version
QUATERNION = 0x59  # ÷ 32768, w x y z

VERSION = 0x46CC

_ACCELERATION_SCALE = 32768.0 / (16.0 * GRAVITY)
_RATE_SCALE = 32768.0 / math.radians(2000.0)
_ANGLE_SCALE = 32768.0 / math.pi
_QUATERNION_SCALE = 32768.0

_TEMPERATURE_C = 31.5
_NOISE_ACCELERATION = 0.02  # m/s²
_NOISE_RATE = 0.002  # rad/s

Vector = tuple[float, float, float]


def encode(kind: int, words: tuple[int, int, int, int]) -> bytes:
    """One frame: four int16, little-endian, and the low byte of the sum of all before."""
    body = struct.pack("<BB4h", 0x55, kind, *(min(max(word, -32768), 32767) for word in words))
    return body + bytes([sum(body) & 0xFF])


def quaternion(trunk: Trunk) -> tuple[float, float, float, float]:
    """Attitude as w, x, y, z (yaw, then pitch, then roll)."""
    cr, sr = math.cos(trunk.roll / 2), math.sin(trunk.roll / 2)
    cp, sp = math.cos(trunk.pitch / 2), math.sin(trunk.pitch / 2)
    cy, sy = math.cos(trunk.yaw / 2), math.sin(trunk.yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def specific_force(trunk: Trunk) -> Vector:
    """What the accelerometer feels (m/s²): acceleration and the reaction to gravity, in its own axes."""
    w, x, y, z = quaternion(trunk)
    ax, ay, az = trunk.acceleration
    az += GRAVITY
    return (
        (1 - 2 * (y * y + z * z)) * ax + 2 * (x * y + w * z) * ay + 2 * (x * z - w * y) * az,
        2 * (x * y - w * z) * ax + (1 - 2 * (x * x + z * z)) * ay + 2 * (y * z + w * x) * az,
        2 * (x * z + w * y) * ax + 2 * (y * z - w * x) * ay + (1 - 2 * (x * x + y * y)) * az,
    )


def angular_rate(before: Trunk, now: Trunk, dt: float) -> Vector:
    """Angular velocity in the sensor's axes (rad/s) from two attitudes."""
    roll, pitch, yaw = ((b - a) / dt for a, b in zip(_angles(before), _angles(now), strict=True))
    sin_roll, cos_roll = math.sin(now.roll), math.cos(now.roll)
    sin_pitch, cos_pitch = math.sin(now.pitch), math.cos(now.pitch)
    return (
        roll - yaw * sin_pitch,
        pitch * cos_roll + yaw * sin_roll * cos_pitch,
        -pitch * sin_roll + yaw * cos_roll * cos_pitch,
    )


def _angles(trunk: Trunk) -> Vector:
    return trunk.roll, trunk.pitch, trunk.yaw


class Imu:
    """The sensor; `frames` measures the trunk and gives the bytes of one cycle."""

    def __init__(self, random_source: random.Random) -> None:
        self._random = random_source
        self._before: Trunk | None = None

    def frames(self, trunk: Trunk, dt: float) -> bytes:
        """Acceleration, angular rate, angle and quaternion, `dt` seconds after the last."""
        rate = angular_rate(self._before or trunk, trunk, dt)
        self._before = trunk
        temperature = round(_TEMPERATURE_C * 100.0)
        return b"".join(
            (
                encode(
                    ACCELERATION,
                    (
                        *self._words(specific_force(trunk), _ACCELERATION_SCALE, _NOISE_ACCELERATION),
                        temperature,
                    ),
                ),
                encode(ANGULAR_RATE, (*self._words(rate, _RATE_SCALE, _NOISE_RATE), temperature)),
                encode(ANGLE, (*self._words(_angles(trunk), _ANGLE_SCALE, 0.0), VERSION)),
                encode(QUATERNION, _quaternion_words(trunk)),
            )
        )

    def _words(self, vector: Vector, scale: float, noise: float) -> tuple[int, int, int]:
        x, y, z = (round(scale * (value + self._random.gauss(0.0, noise))) for value in vector)
        return x, y, z


def _quaternion_words(trunk: Trunk) -> tuple[int, int, int, int]:
    w, x, y, z = (round(part * _QUATERNION_SCALE) for part in quaternion(trunk))
    return w, x, y, z
