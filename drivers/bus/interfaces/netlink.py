"""State of a CAN link as the kernel tells it over rtnetlink: no root needed, nothing changed.

The numbers are those of Linux: rtnetlink.h, if_link.h, can/netlink.h.
"""

import socket
import struct
from collections.abc import Iterator
from dataclasses import dataclass

_HEADER = struct.Struct("=IHHII")  # length, type, flags, sequence, port
_INTERFACE = struct.Struct("=BxHiII")  # family, type, index, flags, change
_ATTRIBUTE = struct.Struct("=HH")  # length, type
_REQUEST = 1
_NEW_LINK, _GET_LINK = 16, 18
_IFF_UP = 1
_LINK_INFO, _INFO_KIND, _INFO_DATA = 18, 1, 2
_CAN_BIT_TIMING, _CAN_STATE, _CAN_RESTART_MS = 1, 4, 6
_NESTED = 0x8000
_TIMEOUT_S = 0.5

CAN_STATES = ("error active", "error warning", "error passive", "bus off", "stopped", "sleeping")


@dataclass(frozen=True, slots=True)
class NetworkInterface:
    """A network interface; the CAN fields are `None` where it has none (vcan has no bitrate)."""

    up: bool
    kind: str | None  # "can", "vcan", "slcan", …
    bitrate: int | None
    restart_ms: int | None
    state: str | None


def read_link(name: str) -> NetworkInterface | None:
    """Return the link called `name`; `None` where there is none.

    Raises `OSError` from a kernel that is silent.
    """
    try:
        index = socket.if_nametoindex(name)
    except OSError:
        return None
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as netlink:
        netlink.settimeout(_TIMEOUT_S)
        netlink.sendto(link_request(index), (0, 0))
        return parse_link(netlink.recv(65536))


def link_request(index: int) -> bytes:
    """Return the message that asks for one link."""
    body = _INTERFACE.pack(socket.AF_UNSPEC, 0, index, 0, 0)
    return _HEADER.pack(_HEADER.size + len(body), _GET_LINK, _REQUEST, 1, 0) + body


def parse_link(message: bytes) -> NetworkInterface | None:
    """Return a link out of the kernel's answer; `None` for any other message."""
    if len(message) < _HEADER.size + _INTERFACE.size:
        return None
    length, kind, *_ = _HEADER.unpack_from(message)
    if kind != _NEW_LINK:
        return None
    _, _, _, flags, _ = _INTERFACE.unpack_from(message, _HEADER.size)
    attributes = dict(_attributes(message[_HEADER.size + _INTERFACE.size : length]))
    info = dict(_attributes(attributes.get(_LINK_INFO, b"")))
    can = dict(_attributes(info.get(_INFO_DATA, b"")))
    state = _number(can.get(_CAN_STATE))
    return NetworkInterface(
        up=bool(flags & _IFF_UP),
        kind=info[_INFO_KIND].rstrip(b"\0").decode("ascii", "replace") if _INFO_KIND in info else None,
        bitrate=_number(can.get(_CAN_BIT_TIMING)) or None,
        restart_ms=_number(can.get(_CAN_RESTART_MS)),
        state=CAN_STATES[state] if state is not None and state < len(CAN_STATES) else None,
    )


def _attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + _ATTRIBUTE.size <= len(data):
        length, kind = _ATTRIBUTE.unpack_from(data, at)
        if length < _ATTRIBUTE.size:
            return
        yield kind & ~_NESTED, data[at + _ATTRIBUTE.size : at + length]
        at += (length + 3) & ~3


def _number(data: bytes | None) -> int | None:
    return None if data is None or len(data) < 4 else int.from_bytes(data[:4], "little")
