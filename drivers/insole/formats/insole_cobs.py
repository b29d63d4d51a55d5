"""Format `insole-cobs`: the default binary insole frame, COBS-encoded and ended by a zero byte.

Decoded, little-endian: u8 31h · u8 flags (bit 0 right foot, 1 calibrated in 0.1 kPa, 2 saturated, 3 cells
missing) · u16 sequence · u32 time in µs (wraps) · u8 n (1 to 64) · u8 converter bits · n × u16 ·
u16 CRC-16/CCITT-FALSE over all before it. With bit 3 set, a cell of FFFFh is one that is missing.

Each foot counts its own sequence. COBS: Cheshire and Baker, "Consistent Overhead Byte Stuffing", 1999.
"""

import binascii
import struct

from drivers.clock import ClockSpec
from drivers.insole.foot import FEET
from drivers.insole.format import Format
from drivers.insole.frame import InsoleFrame
from drivers.parsing import DelimitedParser, Sequence

VERSION = 0x31
RIGHT, CALIBRATED, SATURATED, MISSING = 0x01, 0x02, 0x04, 0x08
HEADER = struct.Struct("<BBHIBB")
MAX_CELLS = 64
SHORTEST = HEADER.size + 2 + 2
LONGEST = HEADER.size + 2 * MAX_CELLS + 2
PASCAL_PER_COUNT = 100.0
MISSING_CELL = 0xFFFF

_CELLS = {n: struct.Struct(f"<{n}H") for n in range(1, MAX_CELLS + 1)}


def cobs_decode(encoded: bytes) -> bytes | None:
    """Return the bytes that `encoded` (no zero in it, at most 254 bytes) stands for.

    `None` where it is not COBS.
    """
    decoded = bytearray(encoded)
    at, end = 0, len(decoded)
    while at < end:
        step = decoded[at]
        decoded[at] = 0
        at += step
    return bytes(decoded[1:]) if at == end else None


class InsoleCobsParser(DelimitedParser[InsoleFrame]):
    """Parser of `insole-cobs`, one or both feet on the line."""

    longest = LONGEST + 1

    def __init__(self) -> None:
        super().__init__()
        self._sequences = {foot: Sequence(self.counters, 1 << 16) for foot in FEET}

    def _restart(self) -> None:
        for sequence in self._sequences.values():
            sequence.restart()

    def _decode(self, raw: bytes) -> list[InsoleFrame] | None:
        body = cobs_decode(raw)
        if body is None or not SHORTEST <= len(body) <= LONGEST:
            return None
        if binascii.crc_hqx(body[:-2], 0xFFFF) != int.from_bytes(body[-2:], "little"):
            self.counters.bad_checksums += 1
            return None
        version, flags, sequence, time_us, n, bits = HEADER.unpack_from(body)
        if version != VERSION or not 1 <= n <= MAX_CELLS or len(body) != HEADER.size + 2 * n + 2:
            self.counters.malformed += 1
            return None
        return [self._frame(flags, sequence, time_us, bits, _CELLS[n].unpack_from(body, HEADER.size))]

    def _frame(
        self, flags: int, sequence: int, time_us: int, bits: int, counts: tuple[int, ...]
    ) -> InsoleFrame:
        self.counters.saturated += bool(flags & SATURATED)
        calibrated, missing = bool(flags & CALIBRATED), bool(flags & MISSING)
        cells: tuple[float | None, ...] = counts
        if missing:
            cells = tuple(None if count == MISSING_CELL else count for count in counts)
        if calibrated:
            cells = tuple([None if cell is None else cell * PASCAL_PER_COUNT for cell in cells])
        foot = FEET[flags & RIGHT]
        return InsoleFrame(
            cells=cells,
            foot=foot,
            calibrated=calibrated,
            bits=bits,
            saturated=bool(flags & SATURATED),
            missing=missing,
            sequence=sequence,
            ticks=time_us,
            late=self._sequences[foot].is_late(sequence),
        )


FORMAT = Format(parser=lambda _: InsoleCobsParser, clock=ClockSpec(1_000_000, 1 << 32))
