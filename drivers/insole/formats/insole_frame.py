"""Format `insole-frame`: a fixed binary frame, by a description."""

import binascii
import math
import struct
from collections.abc import Callable
from functools import reduce
from operator import xor

from drivers.errors import SettingsError
from drivers.insole import layout as layouts
from drivers.insole.description import Flag, FrameDescription
from drivers.insole.foot import Foot
from drivers.insole.format import MICROSECONDS, Format, MakeParser
from drivers.insole.frame import InsoleFrame
from drivers.insole.frame_order import LONGEST_TIME_S, Order
from drivers.insole.layout import Layout
from drivers.parsing import IMPOSSIBLE, FrameScanner, needs

REALS = ("f32", "f64")
LONGEST = 4096
LETTERS = {
    "u8": "B",
    "i8": "b",
    "u16": "H",
    "i16": "h",
    "u32": "I",
    "i32": "i",
    "f32": "f",
    "f64": "d",
}
Numbers = tuple[float, ...]


def _modbus_of(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
    return byte


_MODBUS = tuple(map(_modbus_of, range(256)))


def _crc16_modbus(data: bytes) -> int:
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _MODBUS[(crc ^ byte) & 0xFF]
    return crc


# name → size in bytes, how to compute it
CHECKSUMS: dict[str, tuple[int, Callable[[bytes], int]]] = {
    "none": (0, lambda _: 0),
    "sum8": (1, lambda data: sum(data) & 0xFF),
    "xor8": (1, lambda data: reduce(xor, data, 0)),
    "crc16-ccitt-false": (2, lambda data: binascii.crc_hqx(data, 0xFFFF)),
    "crc16-xmodem": (2, lambda data: binascii.crc_hqx(data, 0)),
    "crc16-modbus": (2, _crc16_modbus),
}


class InsoleFrameParser(FrameScanner[InsoleFrame]):
    """Parser of `insole-frame`, one or both feet on the line."""

    def __init__(self, description: FrameDescription) -> None:
        super().__init__()
        self._description = description
        self.sync = bytes.fromhex(description.header)
        self._terminator = bytes.fromhex(description.terminator)
        self._checksum_size, self._checksum = CHECKSUMS[description.checksum]
        self._order_mark = "<" if description.byte_order == "little" else ">"
        self._layouts = {
            (field.type, field.count): self._layout(field.type, field.count)
            for field in description.fields
            if isinstance(field.count, int)
        }
        self._counting = {field.count for field in description.fields if isinstance(field.count, str)}
        self._tail = self._checksum_size + len(self._terminator)
        self._order = Order(self.counters, _sequence_modulus(description), each_foot=True)
        self._feet: dict[float, Foot] = {description.foot_left: "left", description.foot_right: "right"}
        self._scale = description.pascal_per_count or _scale_of(description, "cells")
        self._reals = [field.name for field in description.fields if field.type in REALS]
        known = {"cells", "foot", "sequence", *description.time}
        self._others = [field for field in description.fields if field.name not in known]
        if not self._counting:
            self.constant_length = self._length(self._buffer, 0)

    def _restart(self) -> None:
        self._order.restart()

    def _length(self, buffer: bytearray, start: int) -> int:
        """Header, fields (some of which may count later ones), checksum, terminator."""
        at = start + len(self.sync)
        counts: dict[str, int] = {}
        for field in self._description.fields:
            count = counts.get(field.count, 0) if isinstance(field.count, str) else field.count
            if count < 1:
                return IMPOSSIBLE
            layout = self._layouts.get((field.type, count)) or self._layout(field.type, count)
            if at + layout.size - start > LONGEST:
                return IMPOSSIBLE
            if field.name in self._counting:
                if len(buffer) < at + layout.size:
                    return needs(at + layout.size - start)
                counts[field.name] = int(layout.unpack_from(buffer, at)[0])
            at += layout.size
        return at + self._tail - start

    def _layout(self, field_type: str, count: int) -> struct.Struct:
        return struct.Struct(f"{self._order_mark}{count}{LETTERS[field_type]}")

    def _decode(self, raw: bytes) -> InsoleFrame | None:
        body_end = len(raw) - self._tail
        checksum = raw[body_end : body_end + self._checksum_size]
        covered = raw[self._description.checksum_from : body_end]
        order = self._description.byte_order
        if self._checksum(covered) != int.from_bytes(checksum, order) or not raw.endswith(self._terminator):
            self.counters.bad_checksums += 1
            return None
        frame = self._frame(self._fields(raw))
        if frame is None:
            self.counters.malformed += 1
        return frame

    def _fields(self, raw: bytes) -> dict[str, Numbers]:
        at = len(self.sync)
        values: dict[str, Numbers] = {}
        for field in self._description.fields:
            count = int(values[field.count][0]) if isinstance(field.count, str) else field.count
            layout = self._layouts.get((field.type, count)) or self._layout(field.type, count)
            values[field.name] = layout.unpack_from(raw, at)
            at += layout.size
        return values

    def _frame(self, values: dict[str, Numbers]) -> InsoleFrame | None:
        """Return the frame of the fields' raw numbers; `None` where its foot or a number is impossible."""
        description = self._description
        foot: Foot | None = None
        if "foot" in values:
            foot = self._feet.get(values["foot"][0])
            if foot is None:
                return None
        if not all(math.isfinite(number) for name in self._reals for number in values[name]):
            return None
        seconds = sum(values[name][0] * scale for name, scale in description.time.items())
        if not abs(seconds) <= LONGEST_TIME_S:
            return None
        ticks = round(seconds * 1e6) if description.time else None
        sequence = int(values["sequence"][0]) if "sequence" in values else None
        means = {flag.means for flag in description.flags if _is_set(flag, values)}
        missing = "missing" in means or f"{foot}_missing" in means
        saturated = "saturated" in means
        self.counters.saturated += saturated
        scale, counts = self._scale, values["cells"]
        return InsoleFrame(
            cells=(None,) * len(counts) if missing else tuple([number * scale for number in counts]),
            foot=foot,
            calibrated=description.pascal_per_count is not None,
            saturated=saturated,
            missing=missing,
            sequence=sequence,
            ticks=ticks,
            late=self._order.is_late(foot, sequence, ticks),
            more=self._more(values),
        )

    def _more(self, values: dict[str, Numbers]) -> dict[str, float | list[float]]:
        """Return the fields without a meaning of their own, scaled."""
        more: dict[str, float | list[float]] = {}
        for field in self._others:
            scaled = [number * field.scale for number in values[field.name]]
            more[field.name] = scaled[0] if field.count == 1 else scaled
        return more


def _scale_of(description: FrameDescription, name: str) -> float:
    return next(field.scale for field in description.fields if field.name == name)


def _sequence_modulus(description: FrameDescription) -> int:
    sizes = [struct.calcsize(LETTERS[field.type]) for field in description.fields if field.name == "sequence"]
    return 1 << 8 * (sizes[0] if sizes else 4)


def _is_set(flag: Flag, values: dict[str, Numbers]) -> bool:
    number = int(values[str(flag.source)][0])
    return str(number) == flag.equals if flag.mask is None else bool(number & flag.mask)


def _parser(layout: Layout | None) -> MakeParser:
    frame = layout.frame if layout else None
    if frame is None:
        raise SettingsError("insole-frame needs a layout file whose table [frame] describes its frame")
    return lambda: InsoleFrameParser(frame)


def _described() -> list[str]:
    return [name for name in layouts.shipped() if layouts.load(name).frame is not None]


FORMAT = Format(parser=_parser, clock=MICROSECONDS, described=True, identify=_described)
