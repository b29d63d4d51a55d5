"""CiA 301 data and object types, by number and by the names that some files use instead (CiA 301 §7.4.7)."""

from dataclasses import dataclass
from enum import IntEnum


class ObjectType(IntEnum):
    """Object codes (CiA 301 table 42)."""

    NULL = 0
    DOMAIN = 2
    DEFTYPE = 5
    DEFSTRUCT = 6
    VAR = 7
    ARRAY = 8
    RECORD = 9


@dataclass(frozen=True, slots=True)
class DataType:
    """One basic data type; `bits` is `None` where the length varies."""

    name: str
    bits: int | None
    kind: str  # "boolean", "signed", "unsigned", "real", "text" or "bytes"


def _integers(kind: str, name: str, codes: dict[int, int]) -> dict[int, DataType]:
    return {code: DataType(f"{name}{bits}", bits, kind) for code, bits in codes.items()}


DOMAIN = 0x0F

DATA_TYPES: dict[int, DataType] = {
    0x01: DataType("BOOLEAN", 1, "boolean"),
    **_integers(
        "signed",
        "INTEGER",
        {0x02: 8, 0x03: 16, 0x04: 32, 0x10: 24, 0x12: 40, 0x13: 48, 0x14: 56, 0x15: 64},
    ),
    **_integers(
        "unsigned",
        "UNSIGNED",
        {0x05: 8, 0x06: 16, 0x07: 32, 0x16: 24, 0x18: 40, 0x19: 48, 0x1A: 56, 0x1B: 64},
    ),
    0x08: DataType("REAL32", 32, "real"),
    0x11: DataType("REAL64", 64, "real"),
    0x09: DataType("VISIBLE_STRING", None, "text"),
    0x0A: DataType("OCTET_STRING", None, "bytes"),
    0x0B: DataType("UNICODE_STRING", None, "text"),
    0x0C: DataType("TIME_OF_DAY", 48, "bytes"),
    0x0D: DataType("TIME_DIFFERENCE", 48, "bytes"),
    DOMAIN: DataType("DOMAIN", None, "bytes"),
}

DATA_TYPE_BY_NAME = {data_type.name: code for code, data_type in DATA_TYPES.items()}
OBJECT_TYPE_BY_NAME = {"ARR": ObjectType.ARRAY, **{member.name: member for member in ObjectType}}
