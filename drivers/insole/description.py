"""Description of an insole's stream by an integrator: the tables `[csv]` and `[frame]` of a layout file."""

from typing import Annotated, Literal

import msgspec

Scale = Annotated[float, msgspec.Meta(gt=0)]
Column = str | int  # a name in the header, or a place counted from 0
Meaning = Literal["left_missing", "right_missing", "missing", "saturated"]
FieldType = Literal["u8", "i8", "u16", "i16", "u32", "i32", "f32", "f64"]
Checksum = Literal["none", "sum8", "xor8", "crc16-ccitt-false", "crc16-xmodem", "crc16-modbus"]

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


class Flag(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One meaning of one column or field: where `mask` is set in its number, or its text is `equals`."""

    source: Column
    means: Meaning
    mask: int | None = None
    equals: str | None = None

    def __post_init__(self) -> None:
        if (self.mask is None) == (self.equals is None):
            raise ValueError("a flag needs either `mask` or `equals`")


class CsvDescription(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Format `insole-csv`: one scan a line.

    Both feet in one line: `left` and `right` name their columns by a pattern (`L_ch*`; `*` is a number, and
    the cells are in its order). One foot a line: `cells`, and `foot` if the two alternate.
    """

    delimiter: Annotated[str, msgspec.Meta(min_length=1, max_length=1)] = ","
    comment: str = "#"
    columns: tuple[str, ...] | None = None  # the names, where the stream has no header
    left: str | tuple[Column, ...] = "L_ch*"
    right: str | tuple[Column, ...] = "R_ch*"
    cells: str | tuple[Column, ...] = "ch*"
    foot: Column | None = None
    foot_left: tuple[str, ...] = ("L", "l", "left", "Left", "LEFT", "0")
    foot_right: tuple[str, ...] = ("R", "r", "right", "Right", "RIGHT", "1")
    time: Column | None = None
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    sequence: Column | None = None
    sequence_modulus: Annotated[int, msgspec.Meta(ge=2)] = 1 << 32
    sequence_of_each_foot: bool = False  # each foot counts its own lines
    flags: tuple[Flag, ...] = ()
    pascal_per_count: Scale | None = None  # the cells are pressure already


class Field(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One field of a frame; `count` is a number, or the name of the field before it that says it.

    The names `cells`, `foot` and `sequence` have their meaning; any other is passed on, times `scale`.
    """

    name: str
    type: FieldType
    count: Annotated[int, msgspec.Meta(ge=1)] | str = 1
    scale: float = 1.0


class FrameDescription(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Format `insole-frame`: a header, fields, then a checksum or a terminator or both, in this order."""

    header: str  # hex
    fields: tuple[Field, ...]
    byte_order: Literal["little", "big"] = "little"
    checksum: Checksum = "none"
    checksum_from: Annotated[int, msgspec.Meta(ge=0)] = 0  # the first byte that it covers
    terminator: str = ""  # hex
    foot_left: int = 1
    foot_right: int = 2
    time: dict[str, Scale] = {}  # field → seconds a count; their sum is the time
    flags: tuple[Flag, ...] = ()
    pascal_per_count: Scale | None = None

    def __post_init__(self) -> None:
        for key in ("header", "terminator"):
            try:
                bytes.fromhex(getattr(self, key))
            except ValueError as error:
                raise ValueError(f'`{key}` must be bytes in hex, such as "5A 5A"') from error
        if not bytes.fromhex(self.header):
            raise ValueError("`header` needs at least one byte: without it nothing can be found in a stream")
        names: list[str] = []
        reals: list[str] = []
        for field in self.fields:
            if isinstance(field.count, str) and field.count not in names:
                raise ValueError(f"field {field.name!r}: no field {field.count!r} before it says its count")
            if isinstance(field.count, str) and field.count in reals:
                raise ValueError(f"field {field.name!r}: its count {field.count!r} must be a whole number")
            names.append(field.name)
            reals += [field.name] if field.type in ("f32", "f64") else []
        if names.count("cells") != 1:
            raise ValueError("`fields` needs one field named `cells`")
        unknown = (set(self.time) | {str(flag.source) for flag in self.flags}) - set(names)
        if unknown:
            raise ValueError(f"`time` or `flags` name no field: {', '.join(sorted(unknown))}")
