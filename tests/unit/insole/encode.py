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
