"""The IMU formats, written from their makers' manuals: what a device sends."""

import struct


def witmotion(kind: int, a: int, b: int, c: int, last: int) -> bytes:
    """One serial frame of WitMotion: four words and the sum."""
    body = struct.pack("<BB4h", 0x55, kind, a, b, c, last)
    return body + bytes([sum(body) & 0xFF])
