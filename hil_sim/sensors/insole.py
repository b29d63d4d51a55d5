"""A 16-cell insole that sends the default insole format over a serial line.

The frame, little-endian: type `31`, flags (bit 0 right foot, bit 1 calibrated in 0.1 kPa, bit 2 saturated,
bit 3 cells missing), u16 sequence, u32 time in µs, u8 cells, u8 ADC bits, the cells as u16, and
CRC-16/CCITT-FALSE over all of it; COBS-encoded, with a 00 behind.
"""

import binascii
import math
import random
import struct
from collections.abc import Sequence
from typing import NamedTuple

from hil_sim.gait.wearer import Foot

FRAME_TYPE = 0x31
RIGHT_FOOT = 0x01
CALIBRATED = 0x02
SATURATED = 0x04
ADC_BITS = 16
UNIT_PA = 100.0  # 0.1 kPa
FULL_SCALE = 0xFFFF

_SPREAD_X, _SPREAD_Y = 0.045, 0.030  # m, how far the load spreads around the centre of pressure
_NOISE_SHARE = 0.01
_NOISE_COUNTS = 0.6


class Cell(NamedTuple):
    """One cell: centre in the foot frame (m; x forward from the heel, y left), area it stands for (m²)."""

    x: float
    y: float
    area: float


# The sole of the left foot, European size 42; the right one is its mirror image. Heel, midfoot, metatarsal
# heads, toes, in the order in which the cells are sent.
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


def encode(flags: int, sequence: int, time_us: int, cells: Sequence[int], adc_bits: int = ADC_BITS) -> bytes:
    """One frame as it goes over the line."""
    head = struct.pack(
        "<BBHIBB", FRAME_TYPE, flags, sequence & 0xFFFF, time_us & 0xFFFF_FFFF, len(cells), adc_bits
    )
    body = head + struct.pack(f"<{len(cells)}H", *cells)
    crc = binascii.crc_hqx(body, 0xFFFF)
    return cobs_encode(body + crc.to_bytes(2, "little")) + b"\0"


class Insole:
    """One foot's insole; `frame` measures a load and gives the bytes."""

    def __init__(self, right: bool, random_source: random.Random) -> None:
        self._flags = CALIBRATED | (RIGHT_FOOT if right else 0)
        side = -1.0 if right else 1.0
        self._cells = [cell._replace(y=side * cell.y) for cell in CELLS]
        self._random = random_source
        self._sequence = 0

    def frame(self, foot: Foot, time_us: int) -> bytes:
        counts = [self._measure(pressure) for pressure in self.pressures(foot)]
        flags = self._flags | (SATURATED if FULL_SCALE in counts else 0)
        self._sequence += 1
        return encode(flags, self._sequence, time_us, counts)

    def pressures(self, foot: Foot) -> list[float]:
        """Pressure of each cell (Pa): the force, spread around the centre of pressure."""
        shares = [cell.area * self._nearness(cell, foot) for cell in self._cells]
        total = sum(shares)
        return [
            foot.force * share / (total * cell.area) for share, cell in zip(shares, self._cells, strict=True)
        ]

    @staticmethod
    def _nearness(cell: Cell, foot: Foot) -> float:
        x, y = (cell.x - foot.cop_x) / _SPREAD_X, (cell.y - foot.cop_y) / _SPREAD_Y
        return math.exp(-0.5 * (x * x + y * y))

    def _measure(self, pressure: float) -> int:
        noise = self._random.gauss(0.0, 1.0)
        counts = pressure / UNIT_PA * (1.0 + _NOISE_SHARE * noise) + _NOISE_COUNTS * noise
        return min(max(round(counts), 0), FULL_SCALE)
