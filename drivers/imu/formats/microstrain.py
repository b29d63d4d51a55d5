"""Format `microstrain`: MicroStrain (LORD, HBK) inertial sensors, such as 3DM-CV7, -CX5, -GX5 (115200 baud).

MIP packets: 75h 65h · descriptor set · length of the fields · fields · checksum. A field: its whole length,
its descriptor, data, big-endian. The checksum is Fletcher's over all before it, both sums modulo 256. A
packet of sensor data (80h) or filter data (82h) is one moment; where both are sent, they follow each other.
(MicroStrain, "3DM-CV7 User Manual", Data; LORD, "3DM-GX5-35 DCP Manual", 2.3 and 5.)

The sensor's axes are x forward, y right, z down, its world is north-east-down; at rest it feels −1 g along z.
"""

import math
import struct
from typing import Any, NamedTuple

from drivers.clock import ClockSpec
from drivers.imu.conventions import Conventions
from drivers.imu.format import Format
from drivers.imu.frame import ImuFrame, More
from drivers.parsing import IMPOSSIBLE, FrameScanner, needs

HEAD, CHECKSUM = 4, 2  # bytes before and behind the fields
SENSOR, FILTER = 0x80, 0x82
KINDS = {SENSOR: "sensor", FILTER: "filter"}
SETS = frozenset({0x01, 0x0C, 0x0D, 0x13, 0x7F, SENSOR, 0x81, FILTER, *range(0x91, 0x96), 0xA0})
CLOCK = ClockSpec(1_000_000_000, 1 << 64)  # reference time since power-up; it never jumps

STANDARD_GRAVITY = 9.80665
TESLA_PER_GAUSS = 1e-4
PASCAL_PER_MILLIBAR = 100.0
OVERRANGE = 0x0077  # an axis of accelerometer or gyroscope at its end


class Field(NamedTuple):
    """Definition of a field: its layout, its name, and the SI value of its units."""

    layout: struct.Struct
    name: str
    scale: float | None = None
    checked: bool = False  # the last number says whether the others are valid


class Values(NamedTuple):
    """Values of a packet, by name, in SI, and its unknown fields."""

    numbers: dict[str, tuple[Any, ...]]
    unknown: More


def _floats(count: int, name: str, scale: float | None = None) -> Field:
    return Field(struct.Struct(f">{count}f"), name, scale)


def _checked(count: int, name: str) -> Field:
    return Field(struct.Struct(f">{count}fH"), name, checked=True)


# (descriptor set, field's descriptor); None: shared by all sets
FIELDS: dict[tuple[int | None, int], Field] = {
    (SENSOR, 0x04): _floats(3, "acceleration", STANDARD_GRAVITY),
    (SENSOR, 0x05): _floats(3, "angular_velocity"),
    (SENSOR, 0x06): _floats(3, "magnetic_field", TESLA_PER_GAUSS),
    (SENSOR, 0x0A): _floats(4, "orientation"),
    (SENSOR, 0x0C): _floats(3, "roll_pitch_yaw"),
    (SENSOR, 0x17): _floats(1, "pressure", PASCAL_PER_MILLIBAR),
    (SENSOR, 0x18): Field(struct.Struct(">H"), "overrange"),
    (FILTER, 0x03): _checked(4, "orientation"),
    (FILTER, 0x05): _checked(3, "roll_pitch_yaw"),
    (FILTER, 0x0E): _checked(3, "angular_velocity"),
    (FILTER, 0x10): Field(struct.Struct(">3H"), "filter_status"),
    (FILTER, 0x1C): _checked(3, "acceleration"),
    (None, 0xD5): Field(struct.Struct(">Q"), "ticks"),
}
MOTION = ("acceleration", "angular_velocity", "magnetic_field", "orientation", "roll_pitch_yaw")


def fletcher(data: bytes) -> int:
    """Fletcher's checksum with sums modulo 256, the plain sum in the high byte."""
    plain = weighted = 0
    for byte in data:
        plain += byte
        weighted += plain
    return (plain & 0xFF) << 8 | weighted & 0xFF


class MicrostrainParser(FrameScanner[ImuFrame]):
    """Parser of `microstrain`; packets that are no motion come as frames of their own kind."""

    sync = b"\x75\x65"

    def __init__(self) -> None:
        super().__init__()
        self._ticks: int | None = None  # of the packet before

    def _restart(self) -> None:
        self._ticks = None

    def _length(self, buffer: bytearray, start: int) -> int:
        if len(buffer) < start + HEAD:
            return needs(HEAD)
        if buffer[start + 2] not in SETS or buffer[start + 3] < 2:
            return IMPOSSIBLE
        return HEAD + buffer[start + 3] + CHECKSUM

    def _decode(self, raw: bytes) -> ImuFrame | None:
        if fletcher(raw[:-CHECKSUM]) != int.from_bytes(raw[-CHECKSUM:], "big"):
            self.counters.bad_checksums += 1
            return None
        descriptor_set, payload = raw[2], raw[HEAD:-CHECKSUM]
        if descriptor_set not in KINDS:
            return ImuFrame(f"set_{descriptor_set:02x}", more={"data": payload.hex()})
        fields = _fields(payload)
        values = None if fields is None else _values(descriptor_set, fields)
        if values is None:
            self.counters.malformed += 1
            return None
        self.counters.saturated += bool(int(values.numbers.get("overrange", (0,))[0]) & OVERRANGE)
        return self._frame(KINDS[descriptor_set], values)

    def _frame(self, kind: str, values: Values) -> ImuFrame:
        numbers = {**values.numbers}
        (ticks,) = numbers.pop("ticks", (None,))
        if ticks is not None and ticks == self._ticks:
            ticks += 1  # the other set's packet of the same moment is no repetition
        self._ticks = ticks
        motion: dict[str, Any] = {name: numbers.pop(name) for name in MOTION if name in numbers}
        more = {name: told[0] for name, told in numbers.items()}
        return ImuFrame(kind, **motion, ticks=ticks, z_down=True, more={**more, **values.unknown})


def _fields(payload: bytes) -> list[tuple[int, bytes]] | None:
    """Descriptor and data of each field; `None` where they do not fill the payload exactly."""
    fields, at = [], 0
    while at < len(payload):
        length = payload[at]
        if length < 2 or at + length > len(payload):
            return None
        fields.append((payload[at + 1], payload[at + 2 : at + length]))
        at += length
    return fields


def _values(descriptor_set: int, fields: list[tuple[int, bytes]]) -> Values | None:
    """Return the fields' values; `None` if one has a wrong size, or is not a number."""
    values = Values({}, {})
    for descriptor, data in fields:
        field = FIELDS.get((descriptor_set, descriptor)) or FIELDS.get((None, descriptor))
        if field is None:
            values.unknown[f"field_{descriptor:02x}"] = data.hex()
            continue
        if len(data) != field.layout.size:
            return None
        numbers = field.layout.unpack(data)
        if field.checked:
            numbers, valid = numbers[:-1], numbers[-1]
            if not valid:
                continue
        if not all(map(math.isfinite, numbers)):
            return None
        scale = field.scale
        values.numbers[field.name] = numbers if scale is None else tuple(one * scale for one in numbers)
    return values


FORMAT = Format(MicrostrainParser, CLOCK, Conventions(axes=("x", "-y", "-z")))
