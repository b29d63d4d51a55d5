"""The interface that these tests run on: who needs it is skipped where it is not."""

import fcntl
import socket
import struct

import pytest

from drivers.bus.interfaces.netlink import read_link

NAME = "vcan0"
_SIOCGIFFLAGS, _SIOCSIFFLAGS, _IFF_UP = 0x8913, 0x8914, 1

needs_vcan = pytest.mark.skipif(
    read_link(NAME) is None, reason=f"there is no {NAME} here; see tests/socketcan/uml"
)


def set_up(up: bool) -> None:
    """`ip link set vcan0 up` or `down`."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        request = struct.pack("16sH14x", NAME.encode(), 0)
        (flags,) = struct.unpack_from("H", fcntl.ioctl(control, _SIOCGIFFLAGS, request), 16)
        flags = flags | _IFF_UP if up else flags & ~_IFF_UP
        fcntl.ioctl(control, _SIOCSIFFLAGS, struct.pack("16sH14x", NAME.encode(), flags))
