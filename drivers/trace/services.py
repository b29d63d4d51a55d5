"""The small services in words: NMT, SYNC, TIME, EMCY, heartbeat, LSS, error frames (CiA 301, CiA 305)."""

import datetime
from collections.abc import Callable, Mapping

from drivers.bus.emcy import parse_emcy
from drivers.bus.health import STATE_WORDS
from drivers.bus.interfaces.controller_state import bus_state
from drivers.bus.nmt import NmtState, parse_heartbeat
from drivers.lss.master import BITRATES, UNCONFIGURED

_NMT: Mapping[int, str] = {
    0x01: "start",
    0x02: "stop",
    0x80: "enter pre-operational",
    0x81: "reset",
    0x82: "reset communication",
}
_EPOCH = datetime.datetime(1984, 1, 1, tzinfo=datetime.UTC)
_LSS_BYTES = 8


def nmt(data: bytes, name: Callable[[int], str]) -> str:
    """Return an NMT command, and who is meant."""
    if len(data) != 2:
        return f"no NMT command: {len(data)} bytes"
    service = _NMT.get(data[0], f"service 0x{data[0]:02X}, which CiA 301 does not know")
    return f"{service}: {'all nodes' if data[1] == 0 else name(data[1])}"


def sync(data: bytes) -> str:
    """Return a SYNC, with the counter that it may have."""
    return f"counter {data[0]}" if data else ""


def time_of_day(data: bytes) -> str:
    """Return the time that a TIME message tells."""
    if len(data) != 6:
        return f"no TIME: {len(data)} bytes"
    milliseconds = int.from_bytes(data[:4], "little") & 0x0FFF_FFFF
    days = int.from_bytes(data[4:], "little")
    moment = _EPOCH + datetime.timedelta(days=days, milliseconds=milliseconds)
    return moment.isoformat(" ", "milliseconds").removesuffix("+00:00")


def emergency(data: bytes, vendor_id: int | None) -> str:
    """Return an EMCY: its code, the error register, and what its maker adds."""
    found = parse_emcy(0, data)
    if found is None:
        return f"no EMCY: {len(data)} bytes"
    added = f", maker's bytes {found.vendor_data.hex(' ').upper()}" if any(found.vendor_data) else ""
    return f"{'no error any more' if found.resets else found.text(vendor_id)}{added}"


def heartbeat(data: bytes) -> str:
    """Return the state that a node says it is in."""
    state = parse_heartbeat(data)
    if state is None:
        return f"no heartbeat: {data.hex(' ').upper() or 'empty'}"
    return "boot-up" if state is NmtState.BOOT_UP else state.words


def error(can_id: int, data: bytes) -> str:
    """Return an error frame: the controller's state, or an error on the wire."""
    state = bus_state(can_id, data)
    if state is None:
        return "error on the wire"
    return STATE_WORDS.get(state, "the CAN controller is well again")


# LSS (CiA 305): by the first byte.

_PARTS = ("vendor", "product", "revision", "serial number")
_RANGE = ("vendor", "product", "revision from", "revision to", "serial number from", "serial number to")
_RATES = {index: rate for rate, index in BITRATES.items()}


def _number(data: bytes) -> int:
    return int.from_bytes(data[1:5], "little")


def _said(words: str, name: str) -> Callable[[bytes], str]:
    """Words with the number of a frame and the name that it has."""
    return lambda data: words.format(_number(data), name)


def _node(node_id: int) -> str:
    return "none (255)" if node_id == UNCONFIGURED else str(node_id)


def _fastscan(data: bytes) -> str:
    if data[5] == 128:
        return "fastscan: is there anybody without a node id?"
    part = _PARTS[data[6]] if data[6] < len(_PARTS) else f"number {data[6]}"
    return f"fastscan: {part} 0x{_number(data):08X} from bit {data[5]} up?"


def _rate(data: bytes) -> str:
    rate = _RATES.get(data[2]) if data[1] == 0 else None
    return f"bit rate {rate} bit/s" if rate else f"bit rate {data[2]} of table {data[1]}"


_REQUESTS: Mapping[int, Callable[[bytes], str]] = {
    0x04: lambda data: "all: configuration" if data[1] else "all: waiting",
    0x11: lambda data: f"node id {_node(data[1])}",
    0x13: _rate,
    0x15: lambda data: f"activate the bit rate in {int.from_bytes(data[1:3], 'little')} ms",
    0x17: lambda _data: "store",
    **{0x40 + part: _said("select by {1} 0x{0:X}", name) for part, name in enumerate(_PARTS)},
    **{0x46 + place: _said("who has {1} 0x{0:X}?", name) for place, name in enumerate(_RANGE)},
    0x4C: lambda _data: "who has no node id?",
    0x51: _fastscan,
    **{0x5A + part: _said("which {1}?", name) for part, name in enumerate(_PARTS)},
    0x5E: lambda _data: "which node id?",
}


def _result(what: str) -> Callable[[bytes], str]:
    return lambda data: f"{what}: {'done' if not data[1] else f'refused, error {data[1]}'}"


_ANSWERS: Mapping[int, Callable[[bytes], str]] = {
    0x11: _result("node id"),
    0x13: _result("bit rate"),
    0x17: _result("store"),
    0x44: lambda _data: "selected",
    0x4F: lambda _data: "yes",
    0x50: lambda _data: "without a node id",
    **{0x5A + part: _said("{1} 0x{0:X}", name) for part, name in enumerate(_PARTS)},
    0x5E: lambda data: f"node id {_node(data[1])}",
}


def lss(data: bytes, *, answer: bool) -> str:
    """Return a request of the LSS master, or an answer."""
    words = (_ANSWERS if answer else _REQUESTS).get(data[0]) if len(data) == _LSS_BYTES else None
    return f"no LSS that is known: {data.hex(' ').upper() or 'empty'}" if words is None else words(data)
