"""An Xsens MTi (MT low level protocol): Xbus messages `FA FF mid len payload sum` with MTData2 inside."""

import struct

from hil_sim.sensors.serial_sensor import SerialFormat, Tick
from hil_sim.sensors.trunk_imu import AXES, Motion

MTDATA2, WAKE_UP = 0x36, 0x3E

# Items: kind, number format (0: single precision) and frame of reference (0: east-north-up).
TEMPERATURE, COUNTER, TIME_FINE = 0x0810, 0x1020, 0x1060
QUATERNION, ACCELERATION, RATE = 0x2010, 0x4020, 0x8020

_TICK_NS = 100_000


def message(kind: int, payload: bytes) -> bytes:
    """Return one message; all bytes behind FAh add up to 0 modulo 256."""
    body = bytes([0xFF, kind, len(payload)]) + payload
    return b"\xfa" + body + bytes([-sum(body) & 0xFF])


def encode(motion: Motion, tick: Tick) -> bytes:
    items = (
        (COUNTER, struct.pack(">H", tick.number & 0xFFFF)),
        (TIME_FINE, struct.pack(">I", tick.time_ns // _TICK_NS & 0xFFFF_FFFF)),
        (QUATERNION, struct.pack(">4f", *motion.orientation)),
        (ACCELERATION, struct.pack(">3f", *motion.acceleration)),
        (RATE, struct.pack(">3f", *motion.rate)),
        (TEMPERATURE, struct.pack(">f", motion.temperature)),
    )
    return message(MTDATA2, b"".join(struct.pack(">HB", item, len(data)) + data for item, data in items))


XSENS = SerialFormat(encode, baudrate=115200, keys=AXES, banner=message(WAKE_UP, b""))

IMUS = {"xsens": XSENS}
