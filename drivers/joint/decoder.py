"""One TPDO's bytes to a joint's SI values, and its state out of the statusword."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.bus.fields import Field, unpacker
from drivers.bus.pdo import Tpdo
from drivers.joint.cia402 import STATE_BITS, STATE_OF

Values = tuple[float | None, ...]


@dataclass(frozen=True, slots=True)
class Decoder:
    """What is made of one TPDO. `values` stand in the order of `channels`."""

    channels: tuple[int, ...]
    size: int  # bytes that a frame has at least
    values: Callable[[bytes], Values]


def make_decoder(tpdo: Tpdo, fields: Sequence[Field], statusword: int, state: int) -> Decoder:
    """A decoder of `fields`; where one is the channel `statusword`, the channel `state` is made of it."""
    unpack = unpacker(fields)
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
