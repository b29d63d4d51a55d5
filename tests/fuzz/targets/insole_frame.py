"""Insoles that send a frame of their own; the first byte says which description it is read by."""

from typing import Any

import msgspec

from drivers.insole.description import FrameDescription
from drivers.insole.formats.insole_frame import CHECKSUMS, InsoleFrameParser
from tests.fuzz.serial_streams import judge

TOKENS = (b"\x5a\x5a", b"\xaa", b"\x02", b"\x0f\xf0", b"\0\0\x80\x3f", b"\0\0\xc0\x7f", b"\r\n")
MODULES = ("drivers.insole.formats.insole_frame", "drivers.parsing")


def _description(checksum: str, more: dict[str, Any]) -> FrameDescription:
    return msgspec.convert({"header": "5A5A", "checksum": checksum, **more}, FrameDescription)


_FIXED = {
    "fields": [{"name": "foot", "type": "u8"}, {"name": "cells", "type": "u16", "count": 3}],
    "byte_order": "big",
}
_COUNTED = {
    "fields": [
        {"name": "sequence", "type": "u8"},
        {"name": "seconds", "type": "f32"},
        {"name": "n", "type": "i16"},
        {"name": "cells", "type": "i16", "count": "n", "scale": 0.5},
        {"name": "bits", "type": "u8"},
    ],
    "time": {"seconds": 1.0},
    "flags": [
        {"source": "bits", "means": "saturated", "mask": 1},
        {"source": "bits", "means": "missing", "equals": "8"},
    ],
    "terminator": "0D0A",
}
DESCRIPTIONS = tuple(_description(name, more) for name in CHECKSUMS for more in (_FIXED, _COUNTED))


def fuzz(data: bytes) -> None:
    description = DESCRIPTIONS[data[0] % len(DESCRIPTIONS) if data else 0]
    judge(lambda: InsoleFrameParser(description), data[1:])
