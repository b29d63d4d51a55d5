"""A VectorNav VN-100 (user manual): `$VNYMR,…*XX` or `FA groups fields payload CRC16`.

Its axes are x forward, y right, z down; its world is north-east-down.
"""

import binascii
import math
import struct
from functools import reduce
from operator import xor

from hil_sim.sensors.serial_sensor import SerialFormat, Tick
from hil_sim.sensors.trunk_imu import AXES_DOWN, Motion, Vector

# Common group (bit 0): time since start-up, yaw pitch roll, quaternion, rate, acceleration, then magnetic
# field, temperature and pressure.
COMMON, FIELDS = 0x01, 1 << 0 | 1 << 3 | 1 << 4 | 1 << 5 | 1 << 8 | 1 << 10

_MAGNETIC = (0.2, 0.0, 0.4)  # gauss
_PRESSURE = 101.3  # kPa


def _down(vector: Vector) -> Vector:
    """Turn x forward, y left, z up to x forward, y right, z down."""
    x, y, z = vector
    return x, -y, -z


def _yaw_pitch_roll(motion: Motion) -> Vector:
    roll, pitch, yaw = map(math.degrees, _down(motion.angles))
    return yaw, pitch, roll


def encode_ascii(motion: Motion, _tick: Tick) -> bytes:
    """Message VNYMR."""
    angles = ",".join(f"{angle:+08.3f}" for angle in _yaw_pitch_roll(motion))
    field = ",".join(f"{part:+07.4f}" for part in _MAGNETIC)
    force = ",".join(f"{part:+07.3f}" for part in _down(motion.acceleration))
    rate = ",".join(f"{part:+010.6f}" for part in _down(motion.rate))
    body = f"VNYMR,{angles},{field},{force},{rate}".encode("ascii")
    return b"$%s*%02X\r\n" % (body, reduce(xor, body))


def encode_binary(motion: Motion, tick: Tick) -> bytes:
    w, *vector = motion.orientation
    x, y, z = _down((vector[0], vector[1], vector[2]))
    body = struct.pack("<BHQ", COMMON, FIELDS, tick.time_ns & 0xFFFF_FFFF_FFFF_FFFF)
    body += struct.pack("<3f4f", *_yaw_pitch_roll(motion), x, y, z, w)
    body += struct.pack("<3f3f", *_down(motion.rate), *_down(motion.acceleration))
    body += struct.pack("<3f2f", *_MAGNETIC, motion.temperature, _PRESSURE)
    return b"\xfa" + body + binascii.crc_hqx(body, 0).to_bytes(2, "big")


# 118 bytes at 100 Hz are too much for 115200.
VECTORNAV = SerialFormat(encode_ascii, baudrate=230400, keys=AXES_DOWN)
VECTORNAV_BINARY = SerialFormat(encode_binary, baudrate=115200, keys=AXES_DOWN)

IMUS = {"vectornav": VECTORNAV, "vectornav-binary": VECTORNAV_BINARY}
