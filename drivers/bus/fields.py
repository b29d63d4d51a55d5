"""Numbers in a PDO's bytes: unpacked by one precompiled struct where they can be, and made SI by a line."""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

_FORMATS = {
    (8, "signed"): "b",
    (8, "unsigned"): "B",
    (16, "signed"): "h",
    (16, "unsigned"): "H",
    (32, "signed"): "i",
    (32, "unsigned"): "I",
    (32, "real"): "f",
    (64, "signed"): "q",
    (64, "unsigned"): "Q",
    (64, "real"): "d",
}

Unpack = Callable[[bytes], tuple[Any, ...]]  # integers, and floats for reals


@dataclass(frozen=True, slots=True)
class Linear:
    """SI value = counts · scale + offset."""

    scale: float
    offset: float = 0


@dataclass(frozen=True, slots=True)
class Field:
    """One mapped object that becomes a channel's value."""

    channel: int  # index in the component's channels
    at: int  # first bit
    bits: int
    kind: str  # of its data type: "signed", "unsigned", "boolean", or "real" of 32 or 64 bits
    linear: Linear


def unpacker(fields: Sequence[Field]) -> Unpack:
    """Return the function that turns a frame's bytes into the numbers of these fields, in their order."""
    return _by_struct(fields) or _by_bits(fields)


def _by_struct(fields: Sequence[Field]) -> Unpack | None:
    """One struct for fields that lie on whole bytes in the frame's order; `None` for others."""
    layout, position = "<", 0
    for field in fields:
        code = _FORMATS.get((field.bits, field.kind))
        gap = field.at - position
        if code is None or gap < 0 or gap % 8:
            return None
        layout += f"{gap // 8}x{code}"
        position = field.at + field.bits
    return struct.Struct(layout).unpack_from


def _by_bits(fields: Sequence[Field]) -> Unpack:
    """Fields of any width at any bit."""
    layout = tuple((field.at, (1 << field.bits) - 1, _meaning(field)) for field in fields)

    def unpack(data: bytes) -> tuple[Any, ...]:
        frame = int.from_bytes(data, "little")
        return tuple([meaning(frame >> at & mask) for at, mask, meaning in layout])

    return unpack


def _meaning(field: Field) -> Callable[[int], int | float]:
    """Return the number that these bits are."""
    half, wrap = 1 << field.bits >> 1, 1 << field.bits
    if field.kind == "signed":
        return lambda part: part - wrap if part >= half else part
    if field.kind == "real":
        form, size = struct.Struct("<" + _FORMATS[field.bits, "real"]), field.bits // 8
        return lambda part: float(form.unpack(part.to_bytes(size, "little"))[0])
    return lambda part: part
