"""SDO server: which request begins or continues which transfer; expedited transfer (CiA 301 §7.2.4.3)."""

from collections.abc import Callable

from hil_sim.clock import SECOND_NS, Clock, Event
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.coding import size
from hil_sim.node.dictionary import Dictionary, Entry
from hil_sim.node.sdo_block import BLOCK_SIZE, BlockDownload, BlockUpload
from hil_sim.node.sdo_transfer import Received, SegmentedDownload, SegmentedUpload, Transfer

TIMEOUT_NS = 1 * SECOND_NS  # how long a client may be silent in the middle of a transfer

# Client command specifiers, the upper three bits of the first byte.
_DOWNLOAD_SEGMENT, _DOWNLOAD, _UPLOAD, _UPLOAD_SEGMENT, _ABORT, _BLOCK_UPLOAD, _BLOCK_DOWNLOAD = range(7)
# Bits of the first byte that say "not the beginning" of a block transfer.
_SUBCOMMAND = {_BLOCK_UPLOAD: 3, _BLOCK_DOWNLOAD: 1}


class SdoServer:
    """One SDO channel of a device: takes requests of 8 bytes and sends what there is to answer."""

    def __init__(self, clock: Clock, dictionary: Dictionary, send: Callable[[bytes], None]) -> None:
        self._clock = clock
        self._dictionary = dictionary
        self._send = send
        self._transfer: Transfer | None = None
        self._timeout: Event | None = None
        self._initiations = {
            _DOWNLOAD: self._download,
            _UPLOAD: self._upload,
            _BLOCK_UPLOAD: self._block_upload,
            _BLOCK_DOWNLOAD: self._block_download,
        }

    def reset(self) -> None:
        """Forget a transfer, without a word."""
        if self._transfer is not None:
            self._transfer.close()
        self._transfer = None
        self._watch()

    def receive(self, request: bytes) -> None:
        if len(request) != 8:
            return
        multiplexer = self._multiplexer(request)
        try:
            response = self._respond(request)
        except SdoAbort as abort:
            self._abort(multiplexer, abort.code)
            return
        if self._transfer is not None and self._transfer.finished:
            self._transfer = None
        self._watch()
        if response is not None:
            self._send(response)

    def _respond(self, request: bytes) -> bytes | None:
        if request[0] == _ABORT << 5:
            self.reset()
            return None
        if self._transfer is not None and self._transfer.takes(request):
            return self._transfer.respond(request)
        self.reset()  # whatever else comes ends a transfer
        command = request[0] >> 5
        if _continues(request) or command not in self._initiations:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        return self._initiations[command](request)

    def _multiplexer(self, request: bytes) -> bytes:
        """Return the index and sub-index that an abort of this request names."""
        if self._transfer is not None and (self._transfer.takes(request) or _continues(request)):
            return self._transfer.multiplexer
        return bytes(3) if _continues(request) else request[1:4]

    def _abort(self, multiplexer: bytes, code: AbortCode) -> None:
        self.reset()
        self._send(b"\x80" + multiplexer + code.to_bytes(4, "little"))

    def _watch(self) -> None:
        if self._timeout is not None:
            self._timeout.cancel()
        self._timeout = None if self._transfer is None else self._clock.after(TIMEOUT_NS, self._timed_out)

    def _timed_out(self) -> None:
        if self._transfer is not None:
            self._abort(self._transfer.multiplexer, AbortCode.TIMED_OUT)

    # -- the beginnings ----------------------------------------------------------------------------------

    def _read(self, request: bytes) -> bytes:
        return self._dictionary.read(int.from_bytes(request[1:3], "little"), request[3])

    def _writable(self, request: bytes) -> Entry:
        return self._dictionary.find_writable(int.from_bytes(request[1:3], "little"), request[3])

    def _received(self, request: bytes, sized: bool) -> Received:
        announced = int.from_bytes(request[4:8], "little") if sized else None
        return Received(self._writable(request), announced)

    def _upload(self, request: bytes) -> bytes:
        data = self._read(request)
        if 1 <= len(data) <= 4:
            return bytes([0x43 | (4 - len(data)) << 2]) + request[1:4] + data.ljust(4, b"\0")
        self._transfer = SegmentedUpload(request[1:4], data)
        return b"\x41" + request[1:4] + len(data).to_bytes(4, "little")

    def _download(self, request: bytes) -> bytes:
        expedited, sized = bool(request[0] & 2), bool(request[0] & 1)
        if expedited:
            entry = self._writable(request)
            # Where the client does not say how long its data is, the device takes what it needs.
            length = 4 - (request[0] >> 2 & 3) if sized else min(size(entry.data_type) or 4, 4)
            entry.write(request[4 : 4 + length])
        else:
            self._transfer = SegmentedDownload(request[1:4], self._received(request, sized))
        return b"\x60" + request[1:4] + bytes(4)

    def _block_upload(self, request: bytes) -> bytes:
        """Begin a block upload with the client's block size and protocol switch threshold."""
        data, block_size, threshold = self._read(request), request[4], request[5]
        if threshold and len(data) <= threshold:
            return self._upload(request)
        self._transfer = BlockUpload(
            self._clock, self._send, request[1:4], data, block_size, with_crc=bool(request[0] & 4)
        )
        return b"\xc6" + request[1:4] + len(data).to_bytes(4, "little")

    def _block_download(self, request: bytes) -> bytes:
        received = self._received(request, sized=bool(request[0] & 2))
        self._transfer = BlockDownload(request[1:4], received, with_crc=bool(request[0] & 4))
        return b"\xa4" + request[1:4] + bytes([BLOCK_SIZE, 0, 0, 0])


def _continues(request: bytes) -> bool:
    """Return whether a request makes sense only within a transfer."""
    command = request[0] >> 5
    return command in (_DOWNLOAD_SEGMENT, _UPLOAD_SEGMENT) or bool(request[0] & _SUBCOMMAND.get(command, 0))
