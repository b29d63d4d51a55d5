"""SDO client transfers as pure generators: expedited and segmented upload and download (CiA 301 §7.2.4).

A transfer yields the 8 bytes of a request, or `None` where it goes on waiting, and is sent each response.
A response that does not belong to the request (another object, a stale duplicate, a late answer) never
confirms it: it is passed over.
"""

import struct
from collections.abc import Generator

Upload = Generator[bytes | None, bytes, bytes]
Download = Generator[bytes | None, bytes, None]

MAX_UPLOAD = 1 << 20  # bytes; no object of a drive comes near

_HEADER = struct.Struct("<BHB")
_ABORT = 0x80
_TOGGLE = 0x10
_SEGMENT = 7
EXPEDITED = 4  # bytes that fit into the first request

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


def abort_request(index: int, subindex: int, abort_code: int) -> bytes:
    """The request that ends a transfer."""
    return _HEADER.pack(_ABORT, index, subindex) + struct.pack("<I", abort_code)


def upload(index: int, subindex: int) -> Upload:
    """Read an object; returns its bytes as they came."""
    response = yield from _ask(_HEADER.pack(0x40, index, subindex) + bytes(4), index, subindex, 0x40)
    command = response[0]
    if command & 0x02:  # expedited
        unused = (command >> 2) & 3 if command & 0x01 else 0
        return response[4 : 8 - unused]
    size = int.from_bytes(response[4:8], "little") if command & 0x01 else None
    if size is not None and size > MAX_UPLOAD:
        raise SdoProtocolError(f"announces {size} bytes", OUT_OF_MEMORY)
    data = yield from _upload_segments(index, subindex)
    if size is not None and len(data) != size:
        raise SdoProtocolError(f"announced {size} bytes and sent {len(data)}")
    return data


def _upload_segments(index: int, subindex: int) -> Upload:
    data = bytearray()
    toggle = 0
    while True:
        response = yield from _ask_segment(bytes([0x60 | toggle]) + bytes(7), index, subindex, toggle)
        unused = (response[0] >> 1) & 7
        data += response[1 : 8 - unused]
        if response[0] & 0x01:
            return bytes(data)
        if len(data) > MAX_UPLOAD:
            raise SdoProtocolError(f"sent more than {MAX_UPLOAD} bytes", OUT_OF_MEMORY)
        toggle ^= _TOGGLE


def expedited(index: int, subindex: int, data: bytes) -> bytes:
    """The one request that writes an object of up to four bytes."""
    return _HEADER.pack(0x23 | (EXPEDITED - len(data)) << 2, index, subindex) + data.ljust(EXPEDITED, b"\0")


def download(index: int, subindex: int, data: bytes) -> Download:
    """Write an object: done when the device has confirmed the last byte."""
    if not data:
        raise ValueError(f"0x{index:04X}:{subindex:02X}: nothing to write")
    if len(data) <= EXPEDITED:
        yield from _ask(expedited(index, subindex, data), index, subindex, 0x60)
        return
    header = _HEADER.pack(0x21, index, subindex)
    yield from _ask(header + struct.pack("<I", len(data)), index, subindex, 0x60)
    toggle = 0
    for start in range(0, len(data), _SEGMENT):
        segment = data[start : start + _SEGMENT]
        last = start + _SEGMENT >= len(data)
        command = toggle | (_SEGMENT - len(segment)) << 1 | last
        request = bytes([command]) + segment.ljust(_SEGMENT, b"\0")
        yield from _ask_segment(request, index, subindex, toggle, specifier=0x20)
        toggle ^= _TOGGLE


def _ask(request: bytes, index: int, subindex: int, specifier: int) -> Generator[bytes | None, bytes, bytes]:
    """Send `request`; the first response about this very object, as `specifier` or an abort."""
    response = yield request
    while True:
        command, at_index, at_subindex = _HEADER.unpack_from(response)
        if command == _ABORT and (at_index, at_subindex) in ((index, subindex), (0, 0)):
            raise SdoAborted(int.from_bytes(response[4:8], "little"))
        if command & 0xE0 == specifier and (at_index, at_subindex) == (index, subindex):
            return response
        response = yield None


def _ask_segment(
    request: bytes, index: int, subindex: int, toggle: int, specifier: int = 0x00
) -> Generator[bytes | None, bytes, bytes]:
    """Send `request`; the response with its toggle bit. One with the other bit repeats the last one."""
    response = yield request
    while True:
        command, at_index, at_subindex = _HEADER.unpack_from(response)
        if command == _ABORT and (at_index, at_subindex) in ((index, subindex), (0, 0)):
            raise SdoAborted(int.from_bytes(response[4:8], "little"))
        if command & 0xF0 == specifier | toggle:
            return response
        response = yield None
