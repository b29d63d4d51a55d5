"""Measurements of an IMU on the trunk, independent of its format."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import Clock
from hil_sim.gait.wearer import GRAVITY, Trunk
from hil_sim.sensors.faults import ImuFaults, LineFaults

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

# Of a sensor's table in the robot's file: how its axes lie on the trunk.
AXES = 'axes = ["x", "y", "z"]          # which sensor axes point forward, left and up along the trunk\n'
AXES_DOWN = 'axes = ["x", "-y", "-z"]        # which sensor axes point forward, left and up along the trunk\n'

_TEMPERATURE_C = 31.5
_NOISE_ACCELERATION = 0.02  # m/s²
_NOISE_RATE = 0.002  # rad/s


class TrunkSensor(Protocol):
    """Sensor of the trunk's motion, on any line."""

    def tell(self, measured: "Motion", now_ns: int, /) -> None: ...


@dataclass(frozen=True, slots=True)
class BusImu:
    """An IMU on the CAN bus: how it is made, and its table in the robot's file behind header and `bus`."""

    make: Callable[[Clock, CanBus, str, LineFaults], TrunkSensor]
    keys: str


@dataclass(frozen=True, slots=True)
class Motion:
    """One measurement. The sensor's axes are the trunk's: x forward, y left, z up; its world's z is up."""

    angles: Vector  # roll, pitch, yaw (rad): yaw about z, then pitch about y, then roll about x
    orientation: Quaternion  # w, x, y, z: sensor to world
    acceleration: Vector  # m/s², specific force
    rate: Vector  # rad/s
    temperature: float  # °C


class TrunkImu:
    """The sensor itself."""

    def __init__(self, faults: ImuFaults, random_source: random.Random) -> None:
        self._faults = faults
        self._random = random_source
        self._before: Trunk | None = None
        self._last: Motion | None = None
        self._drifted = 0.0

    def measure(self, trunk: Trunk, dt: float) -> Motion:
        """Return the trunk, `dt` seconds after the last measurement."""
        drift = self._faults.drift
        trunk = replace(trunk, pitch=trunk.pitch + self._faults.slipped) if self._faults.slipped else trunk
        self._drifted = self._drifted + drift * dt if drift else 0.0
        if self._last is None or not self._faults.frozen:
            roll, pitch, yaw = angular_rate(self._before or trunk, trunk, dt)
            told = replace(trunk, pitch=trunk.pitch + self._drifted)
            self._last = Motion(
                angles=(told.roll, told.pitch, math.remainder(told.yaw, math.tau)),
                orientation=quaternion(told),
                acceleration=self._clipped(self._noisy(specific_force(trunk), _NOISE_ACCELERATION)),
                rate=self._noisy((roll, pitch + drift, yaw), _NOISE_RATE),
                temperature=_TEMPERATURE_C,
            )
        self._before = trunk
        return self._last

    def _clipped(self, vector: Vector) -> Vector:
        end = self._faults.clipped_at
        x, y, z = (min(max(value, -end), end) for value in vector)
        return x, y, z

    def _noisy(self, vector: Vector, noise: float) -> Vector:
        x, y, z = vector
        gauss = self._random.gauss
        return x + gauss(0.0, noise), y + gauss(0.0, noise), z + gauss(0.0, noise)


def quaternion(trunk: Trunk) -> Quaternion:
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
    """Return the specific force on the accelerometer (m/s²) in its own axes: acceleration minus gravity."""
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
