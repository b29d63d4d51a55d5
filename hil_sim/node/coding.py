"""Values as they travel: little-endian, each in the length of its type (CiA 301 §7.1)."""

import struct

from eds.datatypes import DataType
from hil_sim.node.abort import AbortCode, SdoAbort

Value = int | float | str | bytes

_REAL_FORMATS = {32: "<f", 64: "<d"}
_TEXT_ENCODINGS = {"UNICODE_STRING": "utf-16-le"}  # all others are visible strings
_VISIBLE = "latin-1"


def size(data_type: DataType) -> int | None:
    """Bytes of a value, `None` where the length varies."""
    return None if data_type.bits is None else (data_type.bits + 7) // 8


def empty(data_type: DataType) -> Value:
    """Return the value of an object for which nobody gave one."""
    by_kind: dict[str, Value] = {"text": "", "bytes": bytes(size(data_type) or 0), "real": 0.0}
    return by_kind.get(data_type.kind, 0)


def encode(data_type: DataType, value: Value) -> bytes:
    """Return the value as bytes; integers are saturated to their type."""
    if isinstance(value, bytes):
        return value
    if isinstance(value, str):
        return value.encode(_TEXT_ENCODINGS.get(data_type.name, _VISIBLE), errors="replace")
    if data_type.kind == "real":
        return struct.pack(_REAL_FORMATS[data_type.bits or 32], value)
    signed = data_type.kind == "signed"
    bits = data_type.bits or 32
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    return min(max(int(value), low), high).to_bytes(size(data_type) or 4, "little", signed=signed)


def decode(data_type: DataType, data: bytes) -> Value:
    """Return the value of bytes from the wire; raises `SdoAbort` on the wrong length."""
    check_size(data_type, len(data))
    if data_type.kind == "text":
        return data.decode(_TEXT_ENCODINGS.get(data_type.name, _VISIBLE), errors="replace")
    if data_type.kind == "bytes":
        return data
    if data_type.kind == "real":
        (value,) = struct.unpack(_REAL_FORMATS[data_type.bits or 32], data)
        return float(value)
    return int.from_bytes(data, "little", signed=data_type.kind == "signed")


def check_size(data_type: DataType, length: int) -> None:
    """Refuse a length that the type has not; raises `SdoAbort`."""
    wanted = size(data_type)
    if wanted is not None and length != wanted:
        raise SdoAbort(AbortCode.TOO_LONG if length > wanted else AbortCode.TOO_SHORT)
