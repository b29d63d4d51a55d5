"""An SDO transfer that takes more than one request, and the segmented one (CiA 301 §7.2.4.3)."""

from typing import Protocol

from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.coding import check_size, size
from hil_sim.node.dictionary import Entry

MAX_BYTES = 1 << 20  # that one download may bring where the type of its object sets no length

_DOWNLOAD_SEGMENT, _UPLOAD_SEGMENT = 0, 3
_TOGGLE = 0x10


class Transfer(Protocol):
    """A transfer that is under way; `multiplexer` is the index and sub-index that it is about."""

    multiplexer: bytes
    finished: bool

    def takes(self, request: bytes) -> bool:
        """Return whether a request belongs to this transfer."""

    def respond(self, request: bytes) -> bytes | None:
        """Go on; raises `SdoAbort`."""

    def close(self) -> None:
        """Send nothing more."""


class Received:
    """Data of a download for `entry`; `announced` is the length that the client gave, if any.

    Raises `SdoAbort` as soon as it is seen that it cannot be taken.
    """

    def __init__(self, entry: Entry, announced: int | None) -> None:
        self._entry = entry
        self._announced = announced
        self._data = bytearray()
        if announced is not None:
            check_size(entry.data_type, announced)
            self._check_room(announced)

    def add(self, data: bytes) -> None:
        self._data += data
        # Seven bytes more may be what the last segment of a block is filled up with.
        self._check_room(len(self._data) - 7)

    def drop(self, count: int) -> None:
        """Forget the last bytes: they were filling."""
        del self._data[len(self._data) - count :]

    def write(self) -> None:
        """Everything is there."""
        if self._announced not in (None, len(self._data)):
            raise SdoAbort(AbortCode.LENGTH_MISMATCH)
        self._entry.write(bytes(self._data))

    def __bytes__(self) -> bytes:
        return bytes(self._data)

    def _check_room(self, length: int) -> None:
        wanted = size(self._entry.data_type)
        if wanted is not None and length > wanted:
            raise SdoAbort(AbortCode.TOO_LONG)
        if length > MAX_BYTES:
            raise SdoAbort(AbortCode.OUT_OF_MEMORY)


class _Toggle:
    """The bit that alternates from segment to segment."""

    def __init__(self) -> None:
        self._expected = 0

    def check(self, request: bytes) -> int:
        if request[0] & _TOGGLE != self._expected:
            raise SdoAbort(AbortCode.TOGGLE_BIT)
        self._expected ^= _TOGGLE
        return request[0] & _TOGGLE


class SegmentedUpload:
    """The server's data, seven bytes a segment."""

    def __init__(self, multiplexer: bytes, data: bytes) -> None:
        self.multiplexer = multiplexer
        self.finished = False
        self._left = data
        self._toggle = _Toggle()

    def takes(self, request: bytes) -> bool:
        return request[0] >> 5 == _UPLOAD_SEGMENT

    def respond(self, request: bytes) -> bytes:
        toggle = self._toggle.check(request)
        segment, self._left = self._left[:7], self._left[7:]
        self.finished = not self._left
        return bytes([toggle | (7 - len(segment)) << 1 | self.finished]) + segment.ljust(7, b"\0")

    def close(self) -> None:
        """Nothing is sent that was not asked for."""


class SegmentedDownload:
    """The client's data, seven bytes a segment."""

    def __init__(self, multiplexer: bytes, received: Received) -> None:
        self.multiplexer = multiplexer
        self.finished = False
        self._received = received
        self._toggle = _Toggle()

    def takes(self, request: bytes) -> bool:
        return request[0] >> 5 == _DOWNLOAD_SEGMENT

    def respond(self, request: bytes) -> bytes:
        toggle = self._toggle.check(request)
        self._received.add(request[1 : 8 - (request[0] >> 1 & 7)])
        if request[0] & 1:
            self.finished = True
            self._received.write()
        return bytes([0x20 | toggle]) + bytes(7)

    def close(self) -> None:
        """Nothing is sent that was not asked for."""
