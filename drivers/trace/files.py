"""Frames in files: candump's log (`candump -l`) and PCAP with SocketCAN frames (link type 227), both ways.

python-can's reader of candump logs takes error frames that it does not know for data, and tells no line.
"""

import re
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final, NamedTuple

from drivers.bus.frames import ERROR, EXTENDED, REMOTE, STANDARD_IDS
from drivers.errors import SettingsError


class Captured(NamedTuple):
    """A frame and when it came: ns of Unix time. The identifier carries its flags (`drivers.bus.frames`).

    `interface` is where it came, as candump names it: empty where nobody has said, as in PCAP.
    """

    stamp_ns: int
    can_id: int
    data: bytes
    interface: str = ""


CANDUMP, PCAP = ".log", ".pcap"
SUFFIXES = (CANDUMP, PCAP)

_CANDUMP_LINE = re.compile(
    r"\((\d+)\.(\d{1,9})\) (\S+) ([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(R\d?|[0-9A-Fa-f]*)( [RT])?"
)
_IDENTIFIER = 0x1FFF_FFFF

# The file header of https://www.tcpdump.org, and the frames of LINKTYPE_CAN_SOCKETCAN.
_FILE: Final = "IHHiIII"
_RECORD: Final = "IIII"
_MICROSECONDS, _NANOSECONDS = 0xA1B2_C3D4, 0xA1B2_3C4D
_SOCKETCAN = 227
_HEADER = struct.Struct(">IBBxx")  # identifier with flags, length, flags of CAN FD; then the data
_MOST_BYTES = 8
_LONGEST = 262_144

Put = Callable[[Captured], object]


def is_file(name: str) -> bool:
    """Return whether a name is that of a recording."""
    return name.endswith(SUFFIXES)


def read(path: Path) -> Iterator[Captured]:
    """Yield the frames of a recording, in its order.

    Raises:
        SettingsError: it cannot be read; the message names file and line, or frame.

    """
    try:
        if path.suffix == PCAP:
            with path.open("rb") as file:
                yield from _read_pcap(path, file)
        else:
            with path.open(encoding="ascii") as text:
                yield from _read_candump(path, text)
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SettingsError(f"{path}: is no candump log: it holds what is no text") from error


def _read_candump(path: Path, file: IO[str]) -> Iterator[Captured]:
    for number, line in enumerate(file, 1):
        if not line.strip():
            continue
        found = _CANDUMP_LINE.fullmatch(line.rstrip())
        frame = None if found is None else _of_candump(found)
        if frame is None:
            raise SettingsError(
                f"{path}: line {number} is no frame of `candump -l`, as in "
                "(1732351378.123456) can0 185#3702 (CAN FD is not for CANopen)"
            )
        yield frame


def _of_candump(found: re.Match[str]) -> Captured | None:
    seconds, fraction, interface, identifier, content, _ = found.groups()
    can_id = int(identifier, 16)
    if len(identifier) > 3 and not can_id & ERROR:
        can_id |= EXTENDED
    if len(identifier) == 3 and can_id > STANDARD_IDS:
        return None
    stamp_ns = int(seconds) * 10**9 + int(fraction.ljust(9, "0"))
    if content.startswith("R"):
        return Captured(stamp_ns, can_id | REMOTE, b"", interface)
    if len(content) % 2 or len(content) > 2 * _MOST_BYTES:
        return None
    return Captured(stamp_ns, can_id, bytes.fromhex(content), interface)


def _read_pcap(path: Path, file: IO[bytes]) -> Iterator[Captured]:
    order, unit_ns = _pcap_header(path, file)
    record = struct.Struct(order + _RECORD)
    number = 0
    while head := file.read(record.size):
        number += 1
        if len(head) < record.size:
            raise SettingsError(f"{path}: ends in the middle of frame {number}")
        seconds, fraction, kept, _ = record.unpack(head)
        content = file.read(kept) if kept <= _LONGEST else b""
        if len(content) < kept or len(content) < _HEADER.size:
            raise SettingsError(f"{path}: ends in the middle of frame {number}")
        can_id, length, _ = _HEADER.unpack_from(content)
        data = content[_HEADER.size : _HEADER.size + length]
        if length > _MOST_BYTES or len(data) < (0 if can_id & REMOTE else length):
            raise SettingsError(f"{path}: frame {number} says {length} bytes, and is none of classic CAN")
        stamp_ns = seconds * 10**9 + fraction * unit_ns
        yield Captured(stamp_ns, can_id, b"" if can_id & REMOTE else data)


def _pcap_header(path: Path, file: IO[bytes]) -> tuple[str, int]:
    """Byte order, and the unit of the fractions of seconds in ns."""
    head = file.read(struct.calcsize("<" + _FILE))
    for order in "<>":
        if len(head) < struct.calcsize(order + _FILE):
            break
        magic, *_, link_type = struct.unpack(order + _FILE, head)
        if magic not in (_MICROSECONDS, _NANOSECONDS):
            continue
        if link_type & 0xFFFF != _SOCKETCAN:
            raise SettingsError(
                f"{path}: holds link type {link_type & 0xFFFF}, not SocketCAN (227): record it with "
                "`tcpdump -i can0 -w FILE`, on the interface itself"
            )
        return order, 1 if magic == _NANOSECONDS else 1000
    raise SettingsError(f"{path}: is no PCAP file (of pcapng: `editcap -F pcap IN OUT` makes one)")


@contextmanager
def writing(path: Path) -> Iterator[Put]:
    """Write frames to a file; its name says in which format. Raises `SettingsError`."""
    if path.suffix not in SUFFIXES:
        raise SettingsError(f"{path}: is to be called *{CANDUMP} (candump) or *{PCAP}")
    try:
        file = path.open("xb")
    except OSError as error:
        raise SettingsError(f"{path}: cannot be written: {error.strerror}") from error
    with file:
        if path.suffix == PCAP:
            file.write(struct.pack("<" + _FILE, _NANOSECONDS, 2, 4, 0, 0, _LONGEST, _SOCKETCAN))
            yield lambda frame: file.write(_to_pcap(frame))
        else:
            yield lambda frame: file.write(_to_candump(frame).encode("ascii", "replace"))


def _to_candump(frame: Captured) -> str:
    interface = re.sub(r"\s", "_", frame.interface) or "can"
    seconds, ns = divmod(frame.stamp_ns, 10**9)
    flags = frame.can_id & ~REMOTE
    if flags & ERROR:
        identifier = f"{flags & (ERROR | _IDENTIFIER):08X}"
    elif flags & EXTENDED:
        identifier = f"{flags & _IDENTIFIER:08X}"
    else:
        identifier = f"{flags:03X}"
    content = "R" if frame.can_id & REMOTE else frame.data.hex().upper()
    return f"({seconds}.{ns // 1000:06d}) {interface} {identifier}#{content}\n"


def _to_pcap(frame: Captured) -> bytes:
    seconds, ns = divmod(frame.stamp_ns, 10**9)
    content = _HEADER.pack(frame.can_id, len(frame.data), 0) + frame.data
    return struct.pack("<" + _RECORD, seconds, ns, len(content), len(content)) + content
