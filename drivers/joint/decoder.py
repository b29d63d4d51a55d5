"""One TPDO's bytes to a joint's SI values, and its state out of the statusword."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.bus.fields import Field, Unpack, unpacker
from drivers.bus.pdo import Tpdo
from drivers.joint.cia402 import STATE_BITS, STATE_OF

Values = tuple[float | None, ...]


@dataclass(frozen=True, slots=True)
class Decoder:
    """Decoder of one TPDO. `values` are in the order of `channels`."""

    channels: tuple[int, ...]
    size: int  # bytes that a frame has at least
    values: Callable[[bytes], Values]


def make_decoder(tpdo: Tpdo, fields: Sequence[Field], statusword: int, state: int) -> Decoder:
    """Return a decoder of `fields`.

    Where one is the channel `statusword`, the channel `state` is made of it.
    """
    unpack = _finite(unpacker(fields)) if any(one.kind == "real" for one in fields) else unpacker(fields)
    linears = tuple((field.linear.scale, field.linear.offset) for field in fields)
    channels = tuple(field.channel for field in fields)

    def plain(data: bytes) -> Values:
        return tuple(
            [
                None if raw is None else raw * scale + offset
                for raw, (scale, offset) in zip(unpack(data), linears, strict=True)
            ]
        )

    if statusword not in channels:
        return Decoder(channels, tpdo.size, plain)
    at = channels.index(statusword)

    def with_state(data: bytes) -> Values:
        raw = unpack(data)
        scaled = [
            None if counts is None else counts * scale + offset
            for counts, (scale, offset) in zip(raw, linears, strict=True)
        ]
        return (*scaled, STATE_OF[raw[at] & STATE_BITS])

    return Decoder((*channels, state), tpdo.size, with_state)


def _finite(unpack: Unpack) -> Unpack:
    """Return a reader of REAL values that gives `None` for NaN and infinity."""
    return lambda data: tuple([raw if math.isfinite(raw) else None for raw in unpack(data)])
