"""SDO server: expedited and segmented transfer, bytes in and bytes out (CiA 301 §7.2.4.3)."""

from dataclasses import dataclass

from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Dictionary

# Client command specifiers, the upper three bits of the first byte.
_DOWNLOAD_SEGMENT = 0
_DOWNLOAD = 1
_UPLOAD = 2
_UPLOAD_SEGMENT = 3
_ABORT = 4

_TOGGLE = 0x10


@dataclass(slots=True)
class _Transfer:
    """A segmented transfer that is under way."""

    index: int
    subindex: int
    download: bool
    data: bytes
    announced: int | None = None
    toggle: int = 0


class SdoServer:
    """One SDO channel of a device: `respond` takes a request of 8 bytes and gives the answer, if any."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._transfer: _Transfer | None = None
        self._commands = {
            _DOWNLOAD_SEGMENT: self._download_segment,
            _DOWNLOAD: self._download,
            _UPLOAD: self._upload,
            _UPLOAD_SEGMENT: self._upload_segment,
        }

    def reset(self) -> None:
        self._transfer = None

    def respond(self, request: bytes) -> bytes | None:
        if len(request) != 8:
            return None
        command = request[0] >> 5
        if command == _ABORT:
            self._transfer = None
            return None
        index, subindex = self._addressed(request, command)
        try:
            if command not in self._commands:
                raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
            return self._commands[command](request)
        except SdoAbort as abort:
            self._transfer = None
            return b"\x80" + _multiplexer(index, subindex) + abort.code.to_bytes(4, "little")

    def _addressed(self, request: bytes, command: int) -> tuple[int, int]:
        if command in (_DOWNLOAD_SEGMENT, _UPLOAD_SEGMENT):
            return (self._transfer.index, self._transfer.subindex) if self._transfer else (0, 0)
        return int.from_bytes(request[1:3], "little"), request[3]

    def _upload(self, request: bytes) -> bytes:
        index, subindex = self._addressed(request, _UPLOAD)
        data = self._dictionary.read(index, subindex)
        if 1 <= len(data) <= 4:
            self._transfer = None
            return bytes([0x43 | (4 - len(data)) << 2]) + request[1:4] + data.ljust(4, b"\0")
        self._transfer = _Transfer(index, subindex, False, data)
        return b"\x41" + request[1:4] + len(data).to_bytes(4, "little")

    def _upload_segment(self, request: bytes) -> bytes:
        transfer = self._continued(request, download=False)
        segment, transfer.data = transfer.data[:7], transfer.data[7:]
        last = not transfer.data
        if last:
            self._transfer = None
        command = (request[0] & _TOGGLE) | (7 - len(segment)) << 1 | last
        return bytes([command]) + segment.ljust(7, b"\0")

    def _download(self, request: bytes) -> bytes:
        index, subindex = self._addressed(request, _DOWNLOAD)
        expedited, sized = request[0] & 2, request[0] & 1
        size = 4 - (request[0] >> 2 & 3) if sized else 4
        if expedited:
            self._transfer = None
            if not sized:  # the device takes what it needs (CiA 301 §7.2.4.3.3, s = 0)
                size = min(self._dictionary.find(index, subindex).size or 4, 4)
            self._dictionary.write(index, subindex, request[4 : 4 + size])
        else:
            self._begin_download(index, subindex, int.from_bytes(request[4:8], "little") if sized else None)
        return b"\x60" + request[1:4] + bytes(4)

    def _begin_download(self, index: int, subindex: int, announced: int | None) -> None:
        entry = self._dictionary.find(index, subindex)
        if not entry.writable:
            raise SdoAbort(AbortCode.READ_ONLY)
        if announced is not None and entry.size is not None and announced != entry.size:
            raise SdoAbort(AbortCode.TOO_LONG if announced > entry.size else AbortCode.TOO_SHORT)
        self._transfer = _Transfer(index, subindex, True, b"", announced)

    def _download_segment(self, request: bytes) -> bytes:
        transfer = self._continued(request, download=True)
        transfer.data += request[1 : 8 - (request[0] >> 1 & 7)]
        if request[0] & 1:
            self._transfer = None
            if transfer.announced not in (None, len(transfer.data)):
                raise SdoAbort(AbortCode.LENGTH_MISMATCH)
            self._dictionary.write(transfer.index, transfer.subindex, transfer.data)
        return bytes([0x20 | (request[0] & _TOGGLE)]) + bytes(7)

    def _continued(self, request: bytes, download: bool) -> _Transfer:
        transfer = self._transfer
        if transfer is None or transfer.download is not download:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        if request[0] & _TOGGLE != transfer.toggle:
            raise SdoAbort(AbortCode.TOGGLE_BIT)
        transfer.toggle ^= _TOGGLE
        return transfer


def _multiplexer(index: int, subindex: int) -> bytes:
    return index.to_bytes(2, "little") + bytes([subindex])
