"""WitMotion's serial frames (WT901 protocol manual): `55 type d0…d7 sum`, four frames a measurement."""

import math
import struct

from hil_sim.gait.wearer import GRAVITY
from hil_sim.sensors.serial_sensor import SerialFormat, Tick
from hil_sim.sensors.trunk_imu import AXES, Motion

HEAD = 0x55
ACCELERATION = 0x51  # ÷ 32768 · 16 g, temperature ÷ 100
ANGULAR_RATE = 0x52  # ÷ 32768 · 2000 °/s, temperature ÷ 100
ANGLE = 0x53  # roll, pitch, yaw ÷ 32768 · 180°, version
QUATERNION = 0x59  # ÷ 32768, w x y z

VERSION = 0x46CC

_FULL_SCALE = 32768
SCALES = {  # counts a unit
    ACCELERATION: _FULL_SCALE / (16.0 * GRAVITY),
    ANGULAR_RATE: _FULL_SCALE / math.radians(2000.0),
    ANGLE: _FULL_SCALE / math.pi,
}


def vectors(motion: Motion) -> dict[int, list[int]]:
    """Return the frames that the serial and the CAN variant share: type and three words."""
    measured = {ACCELERATION: motion.acceleration, ANGULAR_RATE: motion.rate, ANGLE: motion.angles}
    return {kind: [_word(part * SCALES[kind]) for part in vector] for kind, vector in measured.items()}


def frame(kind: int, words: list[int]) -> bytes:
    """Four int16, little-endian, and the low byte of the sum of all before."""
    body = struct.pack("<BB4h", HEAD, kind, *words)
    return body + bytes([sum(body) & 0xFF])


def encode(motion: Motion, _tick: Tick) -> bytes:
    """Acceleration, angular rate, angle and quaternion."""
    last = {ACCELERATION: round(motion.temperature * 100), ANGULAR_RATE: round(motion.temperature * 100)}
    frames = [frame(kind, [*words, last.get(kind, VERSION)]) for kind, words in vectors(motion).items()]
    parts = [_word(part * _FULL_SCALE) for part in motion.orientation]
    return b"".join((*frames, frame(QUATERNION, parts)))


def _word(value: float) -> int:
    return min(max(round(value), -_FULL_SCALE), _FULL_SCALE - 1)


WITMOTION = SerialFormat(encode, baudrate=115200, keys=AXES)

IMUS = {"witmotion": WITMOTION}
