"""The insole formats, written from their description: what a device sends."""

import struct
from collections.abc import Sequence

RIGHT, CALIBRATED, SATURATED, MISSING = 1, 2, 4, 8


def crc16_ccitt_false(data: bytes) -> int:
    """Polynomial 1021h, initial value FFFFh, nothing reflected; "123456789" gives 29B1h."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
    return crc


def cobs(data: bytes) -> bytes:
    """Consistent overhead byte stuffing of fewer than 254 bytes."""
    return b"".join(bytes([len(block) + 1]) + block for block in data.split(b"\0"))


def cobs_frame(
    counts: Sequence[int], *, flags: int = CALIBRATED, sequence: int = 0, time_us: int = 0, bits: int = 12
) -> bytes:
    """One frame of `insole-cobs` with its delimiter."""
    body = struct.pack("<BBHIBB", 0x31, flags, sequence & 0xFFFF, time_us & 0xFFFFFFFF, len(counts), bits)
    body += struct.pack(f"<{len(counts)}H", *counts)
    return cobs(body + struct.pack("<H", crc16_ccitt_false(body))) + b"\0"


def eighteen_cell_frame(foot: int, cells: Sequence[int]) -> bytes:
    """The frame seen on printed soles: AAh, foot, 18 big-endian u16, sum of all before."""
    body = struct.pack(">BB18H", 0xAA, foot, *cells)
    return body + bytes([sum(body) & 0xFF])


class Sender:
    """A device that goes on counting its frames and its time."""

    def __init__(self) -> None:
        self.sequence = 0

    def frame(self, counts: Sequence[int], flags: int = CALIBRATED) -> bytes:
        self.sequence += 1
        return cobs_frame(counts, flags=flags, sequence=self.sequence, time_us=self.sequence * 5000)
