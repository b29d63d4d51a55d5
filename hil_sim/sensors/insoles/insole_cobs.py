"""A 16-cell insole that sends the default insole format over a serial line.

The frame, little-endian: type `31`, flags (bit 0 right foot, bit 1 calibrated in 0.1 kPa, bit 2 saturated,
bit 3 cells missing), u16 sequence, u32 time in µs, u8 cells, u8 ADC bits, the cells as u16, and
CRC-16/CCITT-FALSE over all of it; COBS-encoded, with a 00 behind.
"""

import binascii
import struct
from collections.abc import Sequence

from hil_sim.sensors.serial_sensor import SerialFormat, Tick
from hil_sim.sensors.sole import Cell, Pressures

FRAME_TYPE = 0x31
RIGHT_FOOT, CALIBRATED, SATURATED = 0x01, 0x02, 0x04
ADC_BITS = 16
UNIT_PA = 100.0  # 0.1 kPa
FULL_SCALE = 0xFFFF

# The left foot, European size 42: heel, midfoot, metatarsal heads, toes, in the order in which they are sent.
CELLS = tuple(
    Cell(*values)
    for values in (
        (0.022, -0.015, 0.00092),
        (0.022, 0.015, 0.00092),
        (0.052, -0.016, 0.00096),
        (0.052, 0.016, 0.00096),
        (0.086, -0.017, 0.00088),
        (0.086, 0.019, 0.00096),
        (0.122, -0.020, 0.00092),
        (0.122, 0.022, 0.00100),
        (0.178, -0.032, 0.00096),
        (0.184, -0.014, 0.00084),
        (0.179, 0.003, 0.00084),
        (0.170, 0.020, 0.00084),
        (0.158, 0.036, 0.00088),
        (0.230, -0.024, 0.00088),
        (0.226, 0.000, 0.00080),
        (0.210, 0.023, 0.00080),
    )
)


def cobs_encode(data: bytes) -> bytes:
    """Consistent Overhead Byte Stuffing (Cheshire & Baker 1999), without the delimiter."""
    encoded = bytearray()
    for block in data.split(b"\0"):
        while len(block) >= 254:
            encoded += b"\xff" + block[:254]
            block = block[254:]
        encoded += bytes([len(block) + 1]) + block
    return bytes(encoded)


def frame(flags: int, sequence: int, time_us: int, cells: Sequence[int], adc_bits: int = ADC_BITS) -> bytes:
    """Return one frame as it goes over the line."""
    head = struct.pack(
        "<BBHIBB", FRAME_TYPE, flags, sequence & 0xFFFF, time_us & 0xFFFF_FFFF, len(cells), adc_bits
    )
    body = head + struct.pack(f"<{len(cells)}H", *cells)
    crc = binascii.crc_hqx(body, 0xFFFF)
    return cobs_encode(body + crc.to_bytes(2, "little")) + b"\0"


def encode(pressures: Pressures, tick: Tick) -> bytes:
    flags = CALIBRATED | RIGHT_FOOT * pressures.right | SATURATED * pressures.saturated
    counts = [min(round(pascal / UNIT_PA), FULL_SCALE) for pascal in pressures.pascal]
    return frame(flags, tick.number, tick.time_ns // 1000, counts)


INSOLE = SerialFormat(
    encode,
    baudrate=230400,
    banner=b"ESP-ROM:esp32s3-20210327\r\nrst:0x1 (POWERON)\r\n",
    keys='layout = "insole-16"            # where its cells are; or a .toml file of your own\n',
)
