"""Format `witmotion`: WitMotion's 11-byte serial frames (WT901, HWT905 and relatives).

55h · type · four little-endian words · low byte of the sum of all before. A type a frame: what belongs to one
moment comes in several frames. (WitMotion, "WIT standard communication protocol".)
"""

import math
import struct

from drivers.imu.format import Format
from drivers.imu.frame import ImuFrame
from drivers.imu.rotation import Vector
from drivers.parsing import IMPOSSIBLE, FrameScanner, needs

LENGTH = 11
HEAD = 2  # bytes before the words
STANDARD_GRAVITY = 9.80665
FULL_SCALE = 32768
ACCELERATION = 16 * STANDARD_GRAVITY / FULL_SCALE  # m/s² a count
RATE = math.radians(2000) / FULL_SCALE  # rad/s a count
ANGLE = math.pi / FULL_SCALE  # rad a count
QUATERNION = 1 / FULL_SCALE
CENTI = 0.01  # °C a count of the last word

TIME, ACCELERATIONS, RATES, ANGLES, MAGNETIC, QUATERNIONS = 0x50, 0x51, 0x52, 0x53, 0x54, 0x59
OTHERS = {0x55: "port", 0x56: "barometer", 0x57: "position", 0x58: "ground_speed", 0x5A: "satellites"}
KINDS = frozenset({TIME, ACCELERATIONS, RATES, ANGLES, MAGNETIC, QUATERNIONS, *OTHERS})

_WORDS = struct.Struct("<4h")
_TIME = struct.Struct("<6BH")


class WitmotionParser(FrameScanner[ImuFrame]):
    """Parser of `witmotion`."""

    sync = b"\x55"
    constant_length = LENGTH

    def _length(self, buffer: bytearray, start: int) -> int:
        if len(buffer) < start + 2:
            return needs(2)
        return LENGTH if buffer[start + 1] in KINDS else IMPOSSIBLE

    def _decode(self, raw: bytes) -> ImuFrame | None:
        if raw[1] not in KINDS:
            return None
        if sum(raw[:10]) & 0xFF != raw[10]:
            self.counters.bad_checksums += 1
            return None
        frame, saturated = _decoded(raw[1], raw)
        self.counters.saturated += saturated
        return frame


def _decoded(kind: int, raw: bytes) -> tuple[ImuFrame, bool]:
    """Return the frame in `raw`, and whether a value is at the end of its range."""
    if kind == TIME:
        return _time(raw), False
    a, b, c, last = _WORDS.unpack_from(raw, HEAD)
    if kind == QUATERNIONS:
        parts = (a * QUATERNION, b * QUATERNION, c * QUATERNION, last * QUATERNION)
        return ImuFrame("quaternion", orientation=parts), False
    measured = kind in (ACCELERATIONS, RATES)
    frame = vectors(kind, a, b, c, last * CENTI if measured else None)
    if frame is None:
        return ImuFrame(OTHERS[kind], more={"data": raw[HEAD:-1].hex()}), False
    if kind == ANGLES:
        frame.more["version"] = last & 0xFFFF
    return frame, measured and not -32768 < min(a, b, c) <= max(a, b, c) < 32767


def vectors(kind: int, a: int, b: int, c: int, temperature: float | None = None) -> ImuFrame | None:
    """Return the frame of three words, as serial and CAN variant share them; `None` for other types."""
    if kind == ACCELERATIONS:
        scaled = _scaled(a, b, c, ACCELERATION)
        return ImuFrame("acceleration", acceleration=scaled, temperature=temperature)
    if kind == RATES:
        scaled = _scaled(a, b, c, RATE)
        return ImuFrame("angular_velocity", angular_velocity=scaled, temperature=temperature)
    if kind == ANGLES:
        return ImuFrame("angle", roll_pitch_yaw=_scaled(a, b, c, ANGLE))
    if kind == MAGNETIC:  # the unit depends on the model's magnetometer
        return ImuFrame("magnetic", more={"magnetic_raw_x": a, "magnetic_raw_y": b, "magnetic_raw_z": c})
    return None


def _scaled(a: int, b: int, c: int, scale: float) -> Vector:
    return (a * scale, b * scale, c * scale)


def _time(raw: bytes) -> ImuFrame:
    year, month, day, hour, minute, second, ms = _TIME.unpack_from(raw, HEAD)
    parts = {"year": 2000 + year, "month": month, "day": day, "hour": hour, "minute": minute}
    return ImuFrame("time", more={**parts, "second": second + ms / 1000})


FORMAT = Format(WitmotionParser)
