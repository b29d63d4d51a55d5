"""SDO client transfers as pure generators: expedited and segmented upload and download (CiA 301 §7.2.4).

A transfer yields the 8 bytes of a request and is sent the response to it. Which response that is, among
late, doubled and foreign ones, is for `outstanding` to say; `answers` says which can be.
"""

import struct
from collections.abc import Generator

Upload = Generator[bytes, bytes, bytes]
Download = Generator[bytes, bytes, None]

MAX_UPLOAD = 1 << 20  # bytes; no object of a drive comes near

_HEADER = struct.Struct("<BHB")
ABORT = 0x80
SPECIFIER = 0xE0
_TOGGLE = 0x10
_SEGMENT = 7
EXPEDITED = 4  # bytes that fit into the first request
_UPLOAD, _UPLOAD_SEGMENT, _DOWNLOAD, _DOWNLOAD_SEGMENT = 0x40, 0x60, 0x20, 0x00  # client's specifiers
_UPLOADED, _UPLOADED_SEGMENT, _DOWNLOADED, _DOWNLOADED_SEGMENT = 0x40, 0x00, 0x60, 0x20  # the server's
_BLOCK_DOWNLOADED = 0xA0  # of another client's: block transfers are not ours
_ANSWERS = {
    _UPLOAD: _UPLOADED,
    _UPLOAD_SEGMENT: _UPLOADED_SEGMENT,
    _DOWNLOAD: _DOWNLOADED,
    _DOWNLOAD_SEGMENT: _DOWNLOADED_SEGMENT,
}

INVALID_COMMAND = 0x0504_0001
OUT_OF_MEMORY = 0x0504_0005
GENERAL_ERROR = 0x0800_0000
TIMED_OUT = 0x0504_0000


class SdoAborted(Exception):
    """The device ended the transfer."""

    def __init__(self, abort_code: int) -> None:
        super().__init__(f"0x{abort_code:08X}")
        self.abort_code = abort_code


class SdoProtocolError(Exception):
    """The device broke the protocol; the transfer is to be ended with `abort_code`."""

    def __init__(self, message: str, abort_code: int = INVALID_COMMAND) -> None:
        super().__init__(message)
        self.abort_code = abort_code


def multiplexer(index: int, subindex: int) -> bytes:
    """Return an object's name in frames: bytes 1 to 3 of those that name one."""
    return index.to_bytes(2, "little") + bytes([subindex])


def names_object(response: bytes) -> bool:
    """Return whether a response says which object it is about; those of segments do not."""
    return response[0] == ABORT or response[0] & SPECIFIER in (_UPLOADED, _DOWNLOADED)


def answers(response: bytes, request: bytes, about: bytes) -> bool:
    """Return whether a response can answer a request about this object; `about` is its multiplexer."""
    if response[0] == ABORT:
        return response[1:4] == about
    specifier = _ANSWERS[request[0] & SPECIFIER]
    if specifier in (_UPLOADED, _DOWNLOADED):
        return response[0] & SPECIFIER == specifier and response[1:4] == about
    return response[0] & (SPECIFIER | _TOGGLE) == specifier | request[0] & _TOGGLE


def concludes(response: bytes, request: bytes) -> bool:
    """Return whether a response ends the upload that this request began: with data, or refused."""
    ends = response[0] == ABORT or response[0] & (SPECIFIER | 0x02) == _UPLOADED | 0x02
    return ends and request[0] & SPECIFIER == _UPLOAD


def confirmed_write(response: bytes) -> tuple[int, int] | None:
    """Return the object of which a response says that a write of it was taken, or begins; of whomever's."""
    if len(response) == 8 and response[0] & SPECIFIER in (_DOWNLOADED, _BLOCK_DOWNLOADED):
        return int.from_bytes(response[1:3], "little"), response[3]
    return None


def is_expedited_download(request: bytes) -> bool:
    """Return whether a request is a write that needs no other."""
    return request[0] & (SPECIFIER | 0x02) == _DOWNLOAD | 0x02


def abort_request(index: int, subindex: int, abort_code: int) -> bytes:
    """Return the request that ends a transfer."""
    return _HEADER.pack(ABORT, index, subindex) + struct.pack("<I", abort_code)


def upload(index: int, subindex: int) -> Upload:
    """Read an object; returns its bytes as they came."""
    response = yield from _ask(_HEADER.pack(_UPLOAD, index, subindex) + bytes(4))
    command = response[0]
    if command & 0x02:  # expedited
        unused = (command >> 2) & 3 if command & 0x01 else 0
        return response[4 : 8 - unused]
    size = int.from_bytes(response[4:8], "little") if command & 0x01 else None
    if size is not None and size > MAX_UPLOAD:
        raise SdoProtocolError(f"announces {size} bytes", OUT_OF_MEMORY)
    data = yield from _upload_segments()
    if size is not None and len(data) != size:
        raise SdoProtocolError(f"announced {size} bytes and sent {len(data)}")
    return data


def _upload_segments() -> Upload:
    data = bytearray()
    toggle = 0
    while True:
        response = yield from _ask(bytes([_UPLOAD_SEGMENT | toggle]) + bytes(7))
        unused = (response[0] >> 1) & 7
        data += response[1 : 8 - unused]
        if response[0] & 0x01:
            return bytes(data)
        if len(data) > MAX_UPLOAD:
            raise SdoProtocolError(f"sent more than {MAX_UPLOAD} bytes", OUT_OF_MEMORY)
        toggle ^= _TOGGLE


def expedited(index: int, subindex: int, data: bytes) -> bytes:
    """Return the one request that writes an object of up to four bytes."""
    return _HEADER.pack(0x23 | (EXPEDITED - len(data)) << 2, index, subindex) + data.ljust(EXPEDITED, b"\0")


def download(index: int, subindex: int, data: bytes) -> Download:
    """Write an object: done when the device has confirmed the last byte."""
    if not data:
        raise ValueError(f"0x{index:04X}:{subindex:02X}: nothing to write")
    if len(data) <= EXPEDITED:
        yield from _ask(expedited(index, subindex, data))
        return
    yield from _ask(_HEADER.pack(0x21, index, subindex) + struct.pack("<I", len(data)))
    toggle = 0
    for start in range(0, len(data), _SEGMENT):
        segment = data[start : start + _SEGMENT]
        last = start + _SEGMENT >= len(data)
        command = _DOWNLOAD_SEGMENT | toggle | (_SEGMENT - len(segment)) << 1 | last
        yield from _ask(bytes([command]) + segment.ljust(_SEGMENT, b"\0"))
        toggle ^= _TOGGLE


def _ask(request: bytes) -> Generator[bytes, bytes, bytes]:
    response = yield request
    if response[0] == ABORT:
        raise SdoAborted(int.from_bytes(response[4:8], "little"))
    return response
