"""Format `bno08x-rvc`: the CEVA (Hillcrest) BNO08x in UART-RVC mode, 115200 baud, 100 frames a second.

19 bytes: AAh AAh · index · yaw, pitch, roll (0.01°) · acceleration x, y, z (0.001 g), little-endian · motion
intent · motion request · reserved · low byte of the sum of bytes 2 to 17. A text banner at reset is dropped.
(CEVA, "BNO08X datasheet", UART-RVC.)

Its roll turns about y and its pitch about x, as phones have it.
"""

import math
import struct

from drivers.clock import ClockSpec
from drivers.imu import rotation
from drivers.imu.conventions import Conventions
from drivers.imu.format import Format
from drivers.imu.frame import ImuFrame
from drivers.imu.rotation import Quaternion
from drivers.parsing import FrameScanner, Sequence

LENGTH = 19
CLOCK = ClockSpec(100, 256)  # the index of a frame, at its fixed rate
CENTIDEGREE = math.radians(0.01)
MILLI_G = 9.80665e-3

_BODY = struct.Struct("<B6h")


def from_angles(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the orientation: yaw about z, then pitch about x, then roll about y."""
    turned = rotation.multiply(rotation.about_z(yaw), rotation.about_x(pitch))
    return rotation.multiply(turned, rotation.about_y(roll))


class Bno08xRvcParser(FrameScanner[ImuFrame]):
    """Parser of `bno08x-rvc`."""

    sync = b"\xaa\xaa"
    constant_length = LENGTH

    def __init__(self) -> None:
        super().__init__()
        self._sequence = Sequence(self.counters, 256)

    def _restart(self) -> None:
        self._sequence.restart()

    def _length(self, buffer: bytearray, start: int) -> int:  # noqa: ARG002 - one length for all
        return LENGTH

    def _decode(self, raw: bytes) -> ImuFrame | None:
        if sum(raw[2:18]) & 0xFF != raw[18]:
            self.counters.bad_checksums += 1
            return None
        index, yaw, pitch, roll, x, y, z = _BODY.unpack_from(raw, 2)
        return ImuFrame(
            "rvc",
            acceleration=(x * MILLI_G, y * MILLI_G, z * MILLI_G),
            roll_pitch_yaw=(roll * CENTIDEGREE, pitch * CENTIDEGREE, yaw * CENTIDEGREE),
            sequence=index,
            ticks=index,
            late=self._sequence.is_late(index),
        )


FORMAT = Format(Bno08xRvcParser, CLOCK, Conventions(angles=from_angles))
