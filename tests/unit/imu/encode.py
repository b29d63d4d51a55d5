"""The IMU formats, written from their makers' manuals: what a device sends."""

import struct


def witmotion(kind: int, a: int, b: int, c: int, last: int) -> bytes:
    """One serial frame of WitMotion: four words and the sum."""
    body = struct.pack("<BB4h", 0x55, kind, a, b, c, last)
    return body + bytes([sum(body) & 0xFF])


def bno08x_rvc(index: int, yaw: int, pitch: int, roll: int, x: int, y: int, z: int) -> bytes:
    """One UART-RVC frame: angles in 0.01°, acceleration in 0.001 g."""
    body = struct.pack("<B6h3B", index & 0xFF, yaw, pitch, roll, x, y, z, 0, 0, 0)
    return b"\xaa\xaa" + body + bytes([sum(body) & 0xFF])


def xbus(message: int, payload: bytes) -> bytes:
    """One Xbus message."""
    length = bytes([len(payload)]) if len(payload) < 255 else b"\xff" + struct.pack(">H", len(payload))
    body = b"\xff" + bytes([message]) + length + payload
    return b"\xfa" + body + bytes([-sum(body) & 0xFF])


def mtdata2(items: dict[int, bytes]) -> bytes:
    """One MTData2 measurement."""
    return xbus(0x36, b"".join(struct.pack(">HB", item, len(data)) + data for item, data in items.items()))


def vectornav_ascii(text: str) -> bytes:
    """One ASCII message with its XOR checksum and line end."""
    checksum = 0
    for byte in text.encode("ascii"):
        checksum ^= byte
    return f"${text}*{checksum:02X}\r\n".encode("ascii")


def crc16_xmodem(data: bytes) -> int:
    """Polynomial 1021h, initial value 0; "123456789" gives 31C3h."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
    return crc


def vectornav_binary(groups: int, fields: list[int], payload: bytes) -> bytes:
    """One binary message."""
    body = struct.pack(f"<B{len(fields)}H", groups, *fields) + payload
    return b"\xfa" + body + struct.pack(">H", crc16_xmodem(body))
