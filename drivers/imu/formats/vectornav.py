"""Format `vectornav`: VectorNav VN-100 and relatives, ASCII and binary messages in one stream (115200 baud).

ASCII: `$` name `,` values `*` checksum, XOR of all between `$` and `*` (two digits) or CRC-16 (four digits).
Binary: FAh · groups · one u16 of fields a group · payload, little-endian · CRC-16 (polynomial 1021h, initial
value 0, big-endian) over all after FAh. (VectorNav, "VN-100 User Manual".)

The sensor's axes are x forward, y right, z down, and its world is north-east-down.
"""

import binascii
import math
import re
import struct
from functools import reduce
from operator import xor

from drivers.clock import ClockSpec
from drivers.imu.conventions import Conventions
from drivers.imu.format import Format
from drivers.imu.frame import ImuFrame
from drivers.imu.rotation import Vector
from drivers.parsing import IMPOSSIBLE, FrameScanner, needs

BINARY, ASCII = 0xFA, ord("$")
LONGEST_ASCII = 256
TESLA_PER_GAUSS = 1e-4
CLOCK = ClockSpec(1_000_000_000, 1 << 64)  # time since start-up
IN_A_MESSAGE = bytes(byte for byte in range(0x20, 0x7F) if byte != ASCII)  # between `$` and `*`
BEGINNING = re.compile(rb"[$\xfa]")
HEX_DIGITS = frozenset(b"0123456789ABCDEFabcdef")

# What the values of an ASCII message are, in order.
YPR = ("yaw", "pitch", "roll")
QUATERNION = ("qx", "qy", "qz", "qw")
MAGNETIC, ACCELERATION, RATE = ("mx", "my", "mz"), ("ax", "ay", "az"), ("gx", "gy", "gz")
BODY_ACCELERATION = tuple(f"free_acceleration_{axis}" for axis in "xyz")
INERTIAL_ACCELERATION = ("acceleration_north", "acceleration_east", "acceleration_down")
MESSAGES: dict[str, tuple[str, ...]] = {
    "VNYPR": YPR,
    "VNQTN": QUATERNION,
    "VNQMR": (*QUATERNION, *MAGNETIC, *ACCELERATION, *RATE),
    "VNMAG": MAGNETIC,
    "VNACC": ACCELERATION,
    "VNGYR": RATE,
    "VNMAR": (*MAGNETIC, *ACCELERATION, *RATE),
    "VNYMR": (*YPR, *MAGNETIC, *ACCELERATION, *RATE),
    "VNYBA": (*YPR, *BODY_ACCELERATION, *RATE),
    "VNYIA": (*YPR, *INERTIAL_ACCELERATION, *RATE),
    "VNIMU": (*MAGNETIC, *ACCELERATION, *RATE, "temperature", "pressure_kilopascal"),
}

# Sizes of a group's fields in bytes, bit 0 first (VN-100 and VN-200; 0: reserved).
GROUPS: tuple[tuple[int, ...], ...] = (
    (8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8, 0),  # common
    (8, 8, 8, 2, 8, 8, 8, 4, 4, 1, 0, 0, 0, 0, 0, 0),  # time
    (2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 0, 0, 0, 0),  # IMU
    (8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 32, 0, 0, 0),  # GNSS
    (2, 12, 16, 36, 12, 12, 12, 12, 12, 0, 0, 0, 0, 0, 0, 0),  # attitude
    (2, 24, 24, 12, 12, 12, 12, 12, 12, 4, 4, 0, 0, 0, 0, 0),  # INS
)
# (group, bit) → names of the floats in it
FLOATS: dict[tuple[int, int], tuple[str, ...]] = {
    (0, 3): YPR,
    (0, 4): QUATERNION,
    (0, 5): RATE,
    (0, 8): ACCELERATION,
    (0, 10): (*MAGNETIC, "temperature", "pressure_kilopascal"),
    (2, 4): ("temperature",),
    (2, 5): ("pressure_kilopascal",),
    (2, 8): MAGNETIC,
    (2, 9): ACCELERATION,
    (2, 10): RATE,
    (4, 1): YPR,
    (4, 2): QUATERNION,
    (4, 6): BODY_ACCELERATION,
}
TIME_STARTUP = frozenset({(0, 0), (1, 0)})  # u64, ns since power-up


class VectornavParser(FrameScanner[ImuFrame]):
    """Parser of `vectornav`."""

    sync = b"$"  # or FAh: see `_find`
    idle = b"\r\n"

    def finish(self) -> list[ImuFrame]:
        """End of the stream: it also ends an ASCII message that has no line end."""
        frames = self.feed(b"\r\n")
        super().finish()
        return frames

    def _find(self, buffer: bytearray, start: int, end: int) -> int:
        found = BEGINNING.search(buffer, start, end)
        return -1 if found is None else found.start()

    def _length(self, buffer: bytearray, start: int) -> int:
        return (_binary_length if buffer[start] == BINARY else _ascii_length)(buffer, start)

    def _decode(self, raw: bytes) -> ImuFrame | None:
        return self._decode_binary(raw) if raw[0] == BINARY else self._decode_ascii(raw)

    def _decode_ascii(self, raw: bytes) -> ImuFrame | None:
        body, _, checksum = raw[1:].partition(b"*")
        right = reduce(xor, body, 0) if len(checksum) == 2 else binascii.crc_hqx(body, 0)
        if int(checksum, 16) != right:
            self.counters.bad_checksums += 1
            return None
        name, *fields = body.decode("ascii").split(",")
        names = MESSAGES.get(name)
        if names is None:
            return ImuFrame(name.lower(), more={"data": ",".join(fields)})
        values = _values(names, fields)
        if values is None:
            self.counters.malformed += 1
            return None
        return _frame(name.lower(), values, None)

    def _decode_binary(self, raw: bytes) -> ImuFrame | None:
        if binascii.crc_hqx(raw[1:], 0):
            self.counters.bad_checksums += 1
            return None
        values: dict[str, float] = {}
        ticks: int | None = None
        for field, at, size in _layout(raw, 0)[0]:
            if field in FLOATS:
                values |= zip(FLOATS[field], struct.unpack_from(f"<{size // 4}f", raw, at), strict=True)
            elif field in TIME_STARTUP:
                ticks = int.from_bytes(raw[at : at + size], "little")
        if not all(map(math.isfinite, values.values())):
            self.counters.malformed += 1
            return None
        return _frame("binary", values, ticks)


def _ascii_length(buffer: bytearray, start: int) -> int:
    """Return the length up to the checksum's last digit; the byte behind tells if it has two or four."""
    so_far = len(buffer) - start
    star = buffer.find(b"*", start, start + LONGEST_ASCII)
    body = buffer[start + 1 : star if star >= 0 else start + LONGEST_ASCII]
    if body.translate(None, IN_A_MESSAGE):
        return IMPOSSIBLE
    if star < 0:
        return needs(so_far + 1) if so_far < LONGEST_ASCII else IMPOSSIBLE
    digits = buffer[star + 1 : star + 6]
    count = next((at for at, byte in enumerate(digits) if byte not in HEX_DIGITS), len(digits))
    if count == len(digits) and count < 5:
        return needs(so_far + 1)
    return star + 1 + count - start if count in (2, 4) else IMPOSSIBLE


def _binary_length(buffer: bytearray, start: int) -> int:
    if len(buffer) < start + 2:
        return needs(2)
    groups = buffer[start + 1]
    if groups == 0 or groups >> len(GROUPS):
        return IMPOSSIBLE
    head = 2 + 2 * groups.bit_count()
    if len(buffer) < start + head:
        return needs(head)
    fields, end = _layout(buffer, start)
    return end + 2 - start if fields and all(size for _, _, size in fields) else IMPOSSIBLE


def _layout(buffer: bytes | bytearray, start: int) -> tuple[list[tuple[tuple[int, int], int, int]], int]:
    """Return the fields of the binary message at `start`: ((group, bit), place, size), and the end."""
    groups = [group for group in range(len(GROUPS)) if buffer[start + 1] >> group & 1]
    at = start + 2 + 2 * len(groups)
    fields = []
    for place, group in enumerate(groups):
        mask = int.from_bytes(buffer[start + 2 + 2 * place : start + 4 + 2 * place], "little")
        for bit in range(16):
            if mask >> bit & 1:
                fields.append(((group, bit), at, GROUPS[group][bit]))
                at += GROUPS[group][bit]
    return fields, at


def _values(names: tuple[str, ...], fields: list[str]) -> dict[str, float] | None:
    """Return the message's numbers by name; `None` where they are too few, too many or no numbers."""
    try:
        values = dict(zip(names, map(float, fields), strict=True))
    except ValueError:
        return None
    return values if all(map(math.isfinite, values.values())) else None


def _frame(kind: str, values: dict[str, float], ticks: int | None) -> ImuFrame:
    def vector(names: tuple[str, ...], scale: float = 1.0) -> Vector | None:
        if names[0] not in values:
            return None
        a, b, c = (values.pop(name) * scale for name in names)
        return a, b, c

    angles = vector(YPR, math.radians(1.0))
    field, acceleration, rate = vector(MAGNETIC, TESLA_PER_GAUSS), vector(ACCELERATION), vector(RATE)
    quaternion = tuple(values.pop(name) for name in QUATERNION) if "qw" in values else None
    temperature = values.pop("temperature", None)
    if (pressure := values.pop("pressure_kilopascal", None)) is not None:
        values["pressure"] = pressure * 1e3
    return ImuFrame(
        kind,
        acceleration=acceleration,
        angular_velocity=rate,
        roll_pitch_yaw=None if angles is None else (angles[2], angles[1], angles[0]),
        orientation=None
        if quaternion is None
        else (quaternion[3], quaternion[0], quaternion[1], quaternion[2]),
        z_down=True,
        magnetic_field=field,
        temperature=temperature,
        ticks=ticks,
        more={**values},
    )


FORMAT = Format(VectornavParser, CLOCK, Conventions(axes=("x", "-y", "-z")))
