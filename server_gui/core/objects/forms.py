"""A device's value in other notations: decimal, hexadecimal, binary, bits by name, text."""

import re
import struct
from collections.abc import Iterator, Mapping
from typing import Final

from gateway.units import with_minus
from gateway.wire.dictionary import ObjectInfo, ObjectValue
from gateway.wire.method import Number

AXES: Final = range(0x6000, 0xA000)
AXIS_OFFSET: Final = 0x800  # between the objects of two axes of one drive (CiA 402-2)
BYTES: Final = ("OCTET_STRING", "DOMAIN", "TIME_OF_DAY", "TIME_DIFFERENCE")  # told in hexadecimal
TEXTS: Final = ("VISIBLE_STRING", "UNICODE_STRING")
# CiA 402-2 §8.4.1 and §8.4.2; what depends on the mode of operation, and what is the maker's, is left out.
CONTROLWORD: Final[Mapping[int, str]] = {
    0: "switch on",
    1: "enable voltage",
    2: "quick stop (0: active)",
    3: "enable operation",
    7: "fault reset",
    8: "halt",
}
STATUSWORD: Final[Mapping[int, str]] = {
    0: "ready to switch on",
    1: "switched on",
    2: "operation enabled",
    3: "fault",
    4: "voltage enabled",
    5: "quick stop (0: active)",
    6: "switch on disabled",
    7: "warning",
    9: "remote",
    10: "target reached",
    11: "internal limit active",
}
NAMED: Final[Mapping[int, Mapping[int, str]]] = {0x6040: CONTROLWORD, 0x6041: STATUSWORD}
_WIDTH: Final = re.compile(r"(?:UNSIGNED|INTEGER|REAL)(\d+)")
_NUMBERED: Final = re.compile(r"0x([0-9A-Fa-f]{4}):(\d+)")


def place(address: str) -> tuple[int, int]:
    """Return index and sub-index of `0x6041:0`; raises `ValueError` for what is no such address."""
    found = _NUMBERED.fullmatch(address)
    if found is None:
        raise ValueError(f"{address!r} is no object's address")
    return int(found[1], 16), int(found[2])


def for_reading(info: ObjectInfo, words: str) -> str:
    """Return a value's words as they are shown: numbers with the sign for minus, texts as they are."""
    return words if info.type in (*TEXTS, *BYTES) else with_minus(words)


def forms(info: ObjectInfo, held: ObjectValue) -> list[tuple[str, str]]:
    """Return the notations of a value, each with its title; none of what is not known."""
    value = held.value
    if value is None:
        return []
    if isinstance(value, str):
        return list(_of_text(info, value))
    return list(_of_float(info, value) if isinstance(value, float) else _of_integer(info, value))


def bits_by_name(info: ObjectInfo, value: int) -> list[tuple[int, str, bool]]:
    """Bit, name and whether it is set, of a controlword or statusword; none of others."""
    index, subindex = place(info.object)
    of_first = (index - AXES.start) % AXIS_OFFSET + AXES.start if index in AXES else index
    names = NAMED.get(of_first, {}) if subindex == 0 else {}
    return [(bit, name, bool(value >> bit & 1)) for bit, name in names.items()]


def is_other(value: Number | str | None, other: Number | str | None) -> bool:
    """Return whether two values are known, and are not the same."""
    return value is not None and other is not None and value != other


def _of_integer(info: ObjectInfo, value: int) -> Iterator[tuple[str, str]]:
    bits = _bits(info.type) or max(8, -(-value.bit_length() // 8) * 8)
    counts = value % (1 << bits)  # as it lies in the device: two's complement
    yield "Decimal", str(value)
    yield "Hex", f"0x{counts:0{-(-bits // 4)}X}"
    yield "Binary", _grouped(f"{counts:0{bits}b}")
    named = bits_by_name(info, value)
    if named:
        yield "Bits", ", ".join(f"{bit} {name}" for bit, name, is_set in named if is_set) or "none of a name"
    else:
        yield "Bits", ", ".join(str(bit) for bit in range(bits) if counts >> bit & 1) or "none"
    text = counts.to_bytes(-(-bits // 8), "little")
    if bits >= 32 and _is_printable(text):
        yield "Text", text.decode("ascii")


def _of_float(info: ObjectInfo, value: float) -> Iterator[tuple[str, str]]:
    yield "Decimal", repr(value)
    is_small = _bits(info.type) == 32
    yield "Hex", f"0x{struct.pack('>f' if is_small else '>d', value).hex().upper()}"


def _of_text(info: ObjectInfo, value: str) -> Iterator[tuple[str, str]]:
    is_bytes = info.type not in TEXTS and _is_hex(value)
    data = bytes.fromhex(value) if is_bytes else value.encode("utf-8")
    if not is_bytes:
        yield "Text", value
    elif _is_printable(data):
        yield "Text", data.decode("ascii")
    yield "Hex", data.hex(" ").upper() or "nothing"
    yield "Length", f"{len(data)} bytes"


def _bits(type_: str) -> int | None:
    found = _WIDTH.fullmatch(type_)
    return int(found[1]) if found else {"BOOLEAN": 8}.get(type_)


def _grouped(digits: str) -> str:
    return " ".join(digits[max(0, end - 4) : end] for end in range(len(digits) % 4 or 4, len(digits) + 1, 4))


def _is_printable(data: bytes) -> bool:
    return len(data) > 0 and all(32 <= one < 127 for one in data)


def _is_hex(text: str) -> bool:
    try:
        bytes.fromhex(text)
    except ValueError:
        return False
    return True
