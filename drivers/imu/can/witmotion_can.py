"""Format `witmotion-can`: WitMotion's CAN variant, frames of eight bytes without a checksum.

55h · type · three little-endian words. On the bus each is one CAN frame; in a byte capture they follow each
other, and only their heads tell where they are: a frame counts where one ended just before it, or where
another head follows.
"""

import struct

from drivers.imu.format import CanFormat
from drivers.imu.formats.witmotion import KINDS, vectors
from drivers.imu.frame import ImuFrame
from drivers.parsing import IMPOSSIBLE, FrameScanner, needs

HEAD = 0x55
LENGTH = 8

_WORDS = struct.Struct("<3h")


def decode(payload: bytes) -> ImuFrame | None:
    """Return the frame in one CAN payload; `None` where it is not WitMotion's."""
    if len(payload) != LENGTH or not _is_head(payload, 0):
        return None
    kind = payload[1]
    frame = vectors(kind, *_WORDS.unpack_from(payload, 2))
    return frame or ImuFrame(f"type_{kind:02x}", more={"data": payload[2:].hex()})


class WitmotionCanParser(FrameScanner[ImuFrame]):
    """Parser of captured payloads of `witmotion-can`."""

    sync = b"\x55"

    def finish(self) -> list[ImuFrame]:
        """End of the stream: no head follows the last frame."""
        last = decode(bytes(self._buffer))
        if last is not None:
            self.counters.frames += 1
            self._buffer.clear()
        return ([] if last is None else [last]) + super().finish()

    def _length(self, buffer: bytearray, start: int) -> int:
        behind = start + LENGTH
        if len(buffer) < start + 2:
            return needs(2)
        if not _is_head(buffer, start):
            return IMPOSSIBLE
        if start == self.frame_end:
            return LENGTH
        if len(buffer) < behind + 2:
            return needs(LENGTH + 2)
        return LENGTH if _is_head(buffer, behind) else IMPOSSIBLE

    def _looks_behind(self, start: int) -> int:
        return 0 if start == self.frame_end else 2

    def _decode(self, raw: bytes) -> ImuFrame | None:
        return decode(raw)


def _is_head(buffer: bytes | bytearray, at: int) -> bool:
    return buffer[at] == HEAD and buffer[at + 1] in KINDS


FORMAT = CanFormat(decode, WitmotionCanParser, "WitMotion")
