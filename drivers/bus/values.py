"""Object values as bytes and as numbers (CiA 301 §7.1.4: little-endian)."""

import struct

from eds.datatypes import DATA_TYPES

Number = int | float

EXPEDITED = 4  # bytes that a device's answer of one frame has at most


def size_of(data_type: int) -> int | None:
    """Bytes of a data type; `None` where its length varies or it is unknown."""
    known = DATA_TYPES.get(data_type)
    return None if known is None or known.bits is None else (known.bits + 7) // 8


def decode(data: bytes, data_type: int) -> Number | None:
    """Return a number out of an object's bytes; `None` for types that are no numbers.

    Some devices answer with all four bytes of a frame: those beyond the type are cut off. What is longer
    still is something else, such as a text.
    """
    known = DATA_TYPES.get(data_type)
    size = size_of(data_type)
    if known is None or size is None or known.kind == "bytes" or not 0 < len(data) <= max(size, EXPEDITED):
        return None
    data = data[:size]
    if known.kind == "real":
        return None if len(data) < size else float(struct.unpack("<f" if size == 4 else "<d", data)[0])
    return int.from_bytes(data, "little", signed=known.kind == "signed")


def unsigned(data: bytes) -> int:
    """Return the bytes as an unsigned number."""
    return int.from_bytes(data, "little")
