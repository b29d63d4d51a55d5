"""One TPDO's bytes to SI values: unpacked by one precompiled struct, scaled by one precomputed table."""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.bus.pdo import Tpdo
from drivers.joint.cia402 import STATE_BITS, STATE_OF
from drivers.joint.scaling import Linear

_FORMATS = {
    (8, True): "b",
    (8, False): "B",
    (16, True): "h",
    (16, False): "H",
    (32, True): "i",
    (32, False): "I",
}

Values = tuple[float | None, ...]
Unpack = Callable[[bytes], tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class Field:
    """One mapped object that becomes a channel's value."""

    channel: int  # index in the component's channels
    at: int  # first bit
    bits: int
    signed: bool
    linear: Linear


@dataclass(frozen=True, slots=True)
class Decoder:
    """What is made of one TPDO. `values` stand in the order of `channels`."""

    channels: tuple[int, ...]
    size: int  # bytes that a frame has at least
    values: Callable[[bytes], Values]


def make_decoder(tpdo: Tpdo, fields: Sequence[Field], statusword: int, state: int) -> Decoder:
    """A decoder of `fields`; where one is the channel `statusword`, the channel `state` is made of it."""
    unpack = _unpacker(fields)
    linears = tuple((field.linear.scale, field.linear.offset) for field in fields)
    channels = tuple(field.channel for field in fields)

    def plain(data: bytes) -> Values:
        return tuple(
            [raw * scale + offset for raw, (scale, offset) in zip(unpack(data), linears, strict=True)]
        )

    if statusword not in channels:
        return Decoder(channels, tpdo.size, plain)
    at = channels.index(statusword)

    def with_state(data: bytes) -> Values:
        raw = unpack(data)
        scaled = [counts * scale + offset for counts, (scale, offset) in zip(raw, linears, strict=True)]
        return (*scaled, STATE_OF[raw[at] & STATE_BITS])

    return Decoder((*channels, state), tpdo.size, with_state)


def _unpacker(fields: Sequence[Field]) -> Unpack:
    return _by_struct(fields) or _by_bits(fields)


def _by_struct(fields: Sequence[Field]) -> Unpack | None:
    """One struct for fields that lie on whole bytes in the frame's order; `None` for others."""
    layout, position = "<", 0
    for field in fields:
        code = _FORMATS.get((field.bits, field.signed))
        gap = field.at - position
        if code is None or gap < 0 or gap % 8:
            return None
        layout += f"{gap // 8}x{code}"
        position = field.at + field.bits
    return struct.Struct(layout).unpack_from


def _by_bits(fields: Sequence[Field]) -> Unpack:
    """Fields of any width at any bit."""
    layout = tuple((f.at, (1 << f.bits) - 1, 1 << f.bits if f.signed else 0) for f in fields)

    def unpack(data: bytes) -> tuple[int, ...]:
        frame = int.from_bytes(data, "little")
        parts = ((frame >> at & mask, wrap) for at, mask, wrap in layout)
        return tuple(part - wrap if part * 2 >= wrap > 0 else part for part, wrap in parts)

    return unpack
