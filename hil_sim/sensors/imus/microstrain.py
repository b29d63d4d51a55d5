"""A MicroStrain 3DM-CV7 (user manual): MIP packets `75 65 set length fields checksum`, big-endian.

Each measurement is a packet of sensor data (80h) and one of filter data (82h) with the same reference time.
Its axes are x forward, y right, z down; its world is north-east-down.
"""

import itertools
import struct

from hil_sim.gait.wearer import GRAVITY
from hil_sim.sensors.serial_sensor import SerialFormat, Tick
from hil_sim.sensors.trunk_imu import AXES_DOWN, Motion, Vector

SENSOR, FILTER = 0x80, 0x82
ACCELERATION, RATE, QUATERNION, REFERENCE_TIME = 0x04, 0x05, 0x03, 0xD5
VALID = 1


def packet(descriptor_set: int, fields: dict[int, bytes]) -> bytes:
    """Return a packet with its checksum (Fletcher): the sum of all bytes, and the sum of those sums."""
    body = b"".join(bytes([2 + len(data), descriptor]) + data for descriptor, data in fields.items())
    whole = bytes([0x75, 0x65, descriptor_set, len(body)]) + body
    sums = list(itertools.accumulate(whole))
    return whole + bytes([sums[-1] & 0xFF, sum(sums) & 0xFF])


def _down(vector: Vector) -> Vector:
    """Turn x forward, y left, z up to x forward, y right, z down."""
    x, y, z = vector
    return x, -y, -z


def encode(motion: Motion, tick: Tick) -> bytes:
    time = {REFERENCE_TIME: struct.pack(">Q", tick.time_ns & 0xFFFF_FFFF_FFFF_FFFF)}
    force = [part / GRAVITY for part in _down(motion.acceleration)]
    w, x, y, z = motion.orientation
    sensor = {ACCELERATION: struct.pack(">3f", *force), RATE: struct.pack(">3f", *_down(motion.rate))}
    attitude = {QUATERNION: struct.pack(">4fH", w, *_down((x, y, z)), VALID)}
    return packet(SENSOR, time | sensor) + packet(FILTER, time | attitude)


IMUS = {"microstrain": SerialFormat(encode, baudrate=115200, keys=AXES_DOWN)}
