"""SDO block transfer: up to 127 segments for one answer, and a CRC over all (CiA 301 §7.2.4.3.9)."""

from binascii import crc_hqx
from collections.abc import Callable
from enum import Enum, auto

from hil_sim.clock import Clock, Event
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.sdo_transfer import Received

BLOCK_SIZE = 127  # segments that the server takes in one block

_SEGMENT_GAP_NS = 200_000  # what a device takes to bring the next segment of a block
_LAST = 0x80
_BLOCK_UPLOAD, _BLOCK_DOWNLOAD = 5, 6
_END, _RESPONSE, _START = 1, 2, 3  # subcommands


def crc(data: bytes) -> int:
    """x¹⁶ + x¹² + x⁵ + 1 over all data, beginning with 0 (§7.2.4.3.16)."""
    return crc_hqx(data, 0)


class _Stage(Enum):
    READY = auto()  # initiated
    BLOCKS = auto()
    END = auto()  # all data is over there


class BlockUpload:
    """The server's data in blocks; after each the client says how far it came, and the size of the next."""

    def __init__(
        self,
        clock: Clock,
        send: Callable[[bytes], None],
        multiplexer: bytes,
        data: bytes,
        block_size: int,
        with_crc: bool,
    ) -> None:
        self.multiplexer = multiplexer
        self.finished = False
        self._clock = clock
        self._send = send
        self._block_size = _checked(block_size)
        self._crc = crc(data) if with_crc else 0
        self._segments = [data[start : start + 7] for start in range(0, len(data), 7)] or [b""]
        self._acknowledged = 0  # segments
        self._sent = 0  # segments of this block
        self._sending: Event | None = None
        self._stage = _Stage.READY

    def takes(self, request: bytes) -> bool:
        return request[0] >> 5 == _BLOCK_UPLOAD and bool(request[0] & 3)

    def respond(self, request: bytes) -> bytes | None:
        expected = {_Stage.READY: _START, _Stage.BLOCKS: _RESPONSE, _Stage.END: _END}
        if request[0] & 3 != expected[self._stage]:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        if self._stage is _Stage.END:
            self.finished = True
        elif self._stage is _Stage.BLOCKS:
            return self._acknowledge(request[1], request[2])
        else:
            self._stage = _Stage.BLOCKS
            self._send_segment()
        return None

    def close(self) -> None:
        if self._sending is not None:
            self._sending.cancel()
            self._sending = None

    def _acknowledge(self, count: int, block_size: int) -> bytes | None:
        if count > self._sent:
            raise SdoAbort(AbortCode.INVALID_SEQUENCE)
        self.close()
        self._acknowledged += count
        self._sent = 0
        if self._acknowledged == len(self._segments):
            self._stage = _Stage.END
            unused = 7 - len(self._segments[-1])
            return bytes([0xC1 | unused << 2]) + self._crc.to_bytes(2, "little") + bytes(5)
        self._block_size = _checked(block_size)
        self._send_segment()
        return None

    def _send_segment(self) -> None:
        segment = self._segments[self._acknowledged + self._sent]
        self._sent += 1
        last = self._acknowledged + self._sent == len(self._segments)
        self._send(bytes([self._sent | _LAST * last]) + segment.ljust(7, b"\0"))
        if not last and self._sent < self._block_size:
            self._sending = self._clock.after(_SEGMENT_GAP_NS, self._send_segment)


class BlockDownload:
    """The client's data in blocks; after each the server says how many segments it has, in their order."""

    def __init__(self, multiplexer: bytes, received: Received, with_crc: bool) -> None:
        self.multiplexer = multiplexer
        self.finished = False
        self._received = received
        self._with_crc = with_crc
        self._sequence = 0  # the last segment of this block that came in its turn
        self._stage = _Stage.BLOCKS

    def takes(self, request: bytes) -> bool:
        """In the middle of a block everything is a segment."""
        return self._stage is _Stage.BLOCKS or (
            request[0] >> 5 == _BLOCK_DOWNLOAD and bool(request[0] & _END)
        )

    def respond(self, request: bytes) -> bytes | None:
        return self._segment(request) if self._stage is _Stage.BLOCKS else self._end(request)

    def close(self) -> None:
        """Nothing is sent that was not asked for."""

    def _segment(self, request: bytes) -> bytes | None:
        number, last = request[0] & 0x7F, bool(request[0] & _LAST)
        if number == 0:
            raise SdoAbort(AbortCode.INVALID_SEQUENCE)
        in_turn = number == self._sequence + 1
        if in_turn:
            self._sequence = number
            self._received.add(request[1:])
        if not last and number < BLOCK_SIZE:
            return None
        if last and in_turn:
            self._stage = _Stage.END
        response = bytes([0xA0 | _RESPONSE, self._sequence, BLOCK_SIZE]) + bytes(5)
        self._sequence = 0
        return response

    def _end(self, request: bytes) -> bytes:
        self._received.drop(request[0] >> 2 & 7)
        if self._with_crc and crc(bytes(self._received)) != int.from_bytes(request[1:3], "little"):
            raise SdoAbort(AbortCode.CRC_ERROR)
        self._received.write()
        self.finished = True
        return bytes([0xA0 | _END]) + bytes(7)


def _checked(block_size: int) -> int:
    if not 1 <= block_size <= 127:
        raise SdoAbort(AbortCode.INVALID_BLOCK_SIZE)
    return block_size
