"""A Linux CAN interface as a raw socket; where that cannot be, why, and the line to run."""

import errno
import fcntl
import socket
import struct
from pathlib import Path

from hil_sim.bus.can_bus import Frame
from hil_sim.errors import SimulatorError

_FRAME = struct.Struct("=IB3x8s")  # <linux/can.h> struct can_frame: identifier with flags, length, data
_EXTENDED, _REMOTE, _EXTENDED_MASK = 0x8000_0000, 0x4000_0000, 0x1FFF_FFFF
_REQUEST = struct.Struct("16sH14x")  # <linux/if.h> struct ifreq with flags
_SIOCGIFFLAGS, _IFF_UP = 0x8913, 1
_RECEIVE_BUFFER = 4 * 1024 * 1024  # the kernel gives what net.core.rmem_max allows
_INTERFACES = Path("/sys/class/net")

_NO_CAN = (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT)


class InterfaceUnusable(SimulatorError):
    """No frame can pass; the message says what to run."""


def to_bytes(frame: Frame) -> bytes:
    """Return a frame as the kernel takes it."""
    flags = _EXTENDED * frame.extended | _REMOTE * frame.remote
    return _FRAME.pack(frame.cob_id | flags, len(frame.data), frame.data)


def to_frame(data: bytes) -> Frame:
    """Return the kernel's bytes as a frame."""
    identifier, length, payload = _FRAME.unpack(data)
    remote = bool(identifier & _REMOTE)
    content = b"" if remote else payload[:length]
    return Frame(identifier & _EXTENDED_MASK, content, bool(identifier & _EXTENDED), remote)


def open_interface(name: str) -> socket.socket:
    """Return a socket, not blocking, that carries every frame of the interface but its own.

    Raises:
        InterfaceUnusable: there is no such interface, it is no CAN interface, or it is down.

    """
    try:
        socket.if_nametoindex(name)
    except OSError as error:
        raise InterfaceUnusable(_missing(name)) from error
    try:
        sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    except OSError as error:
        raise InterfaceUnusable(_refused(name, error)) from error
    try:
        sock.bind((name,))
        if not _is_up(sock, name):
            raise InterfaceUnusable(f"{name} is down; run: {_up_line(name)}")
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
        sock.setblocking(False)
    except OSError as error:
        sock.close()
        raise InterfaceUnusable(_refused(name, error)) from error
    except InterfaceUnusable:
        sock.close()
        raise
    return sock


def _is_up(sock: socket.socket, name: str) -> bool:
    answer = fcntl.ioctl(sock, _SIOCGIFFLAGS, _REQUEST.pack(name.encode(), 0))
    flags: int = _REQUEST.unpack(answer)[1]
    return bool(flags & _IFF_UP)


def _up_line(name: str) -> str:
    """Real adapters need a bit rate, virtual and serial-line ones take none here."""
    if (_INTERFACES / name / "device").exists():
        return f"sudo ip link set {name} up type can bitrate 1000000 restart-ms 100"
    return f"sudo ip link set {name} up"


def _missing(name: str) -> str:
    if name.startswith("vcan"):
        return (
            f"there is no interface {name}; run: sudo modprobe vcan && sudo ip link add {name} type vcan "
            f"&& sudo ip link set {name} up"
        )
    return f"there is no interface {name}: plug the adapter in, or load its driver"


def _refused(name: str, error: OSError) -> str:
    if error.errno in _NO_CAN:
        return f"{name} cannot be used, this kernel has no CAN; run: sudo modprobe can_raw"
    if error.errno == errno.ENODEV:
        return f"{name} is no CAN interface; `ip link` shows which there are"
    return f"{name} cannot be used: {error.strerror}"
