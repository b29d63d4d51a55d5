"""PDO mapping: the mapped objects, and those that may be mapped (CiA 301 §7.5.2.36, §7.5.2.38)."""

import struct
from contextlib import suppress
from dataclasses import dataclass
from typing import Self

from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.coding import size
from hil_sim.node.dictionary import Dictionary, Entry, Key

MAX_BITS = 64

_CODES = {
    (kind, bits): code
    for kind, codes in (("signed", "bhiq"), ("unsigned", "BHIQ"))
    for bits, code in zip((8, 16, 32, 64), codes, strict=True)
}
_FIRST_OBJECT = 0x20  # below are dummy entries: data types that only take room
_NOT_SENT = ("wo", "rww")  # access types of objects that only RPDOs may carry
_NOT_RECEIVED = ("ro", "const", "rwr")


@dataclass(frozen=True, slots=True)
class Field:
    """One mapped object, `None` for a dummy, and its length in bits."""

    key: Key
    entry: Entry | None
    bits: int

    @classmethod
    def of(cls, dictionary: Dictionary, value: int) -> Self:
        """Return the field that a mapping's entry names; raises `SdoAbort` where there is no such object."""
        key, bits = (value >> 16, value >> 8 & 0xFF), value & 0xFF
        entry = dictionary.get(key)
        if entry is None and (key[0] >= _FIRST_OBJECT or not value):
            raise SdoAbort(AbortCode.NO_SUCH_OBJECT if value else AbortCode.NOT_MAPPABLE)
        return cls(key, entry, bits)

    def check(self, dictionary: Dictionary, received: bool) -> None:
        """Raise `SdoAbort` where the object may not be in an RPDO (`received`) or TPDO."""
        if self.entry is None:
            fits = received and dictionary.dummies.get(self.key) == self.bits
        else:
            excluded = _NOT_RECEIVED if received else _NOT_SENT
            data_type = self.entry.data_type
            lengths = (data_type.bits, 8 * (size(data_type) or 0))
            fits = self.entry.mappable and self.entry.access not in excluded and self.bits in lengths
        if not fits:
            raise SdoAbort(AbortCode.NOT_MAPPABLE)


class Mapping:
    """The objects of one PDO, in the order of their bits; none at all where it is deactivated."""

    def __init__(self, fields: tuple[Field, ...] = ()) -> None:
        bits = sum(field.bits for field in fields)
        if bits > MAX_BITS:
            raise SdoAbort(AbortCode.PDO_TOO_LONG)
        self.fields = fields
        self.keys = frozenset(field.key for field in fields)
        self.length = (bits + 7) // 8
        self._layout = _layout(fields)
        self._entries = tuple(field.entry for field in fields if field.entry is not None)

    @classmethod
    def read(cls, dictionary: Dictionary, index: int, count: int) -> Self:
        """Return the first `count` entries of the mapping `index`; raises `SdoAbort` where that cannot be."""
        slots = [dictionary.get((index, number)) for number in range(1, count + 1)]
        values = [slot.number() for slot in slots if slot is not None]
        if len(values) < count:
            raise SdoAbort(AbortCode.PDO_TOO_LONG)
        return cls(tuple(Field.of(dictionary, value) for value in values))

    @classmethod
    def current(cls, dictionary: Dictionary, index: int) -> Self:
        """Return the mapping as it stands; none where a device's own defaults map what it has not."""
        with suppress(SdoAbort):
            return cls.read(dictionary, index, dictionary.number((index, 0)))
        return cls()

    def pack(self) -> bytes:
        if self._layout is not None:
            try:
                return self._layout.pack(
                    *[entry.value if entry.source is None else entry.source() for entry in self._entries]
                )
            except struct.error:  # a value beyond its type, which is saturated
                pass
        packed, shift = 0, 0
        for field in self.fields:
            if field.entry is not None:
                packed |= (int.from_bytes(field.entry.encode(), "little") & (1 << field.bits) - 1) << shift
            shift += field.bits
        return packed.to_bytes(self.length, "little")

    def unpack(self, data: bytes) -> None:
        """Write the values into the dictionary; one that is refused leaves its object as it was."""
        if self._layout is not None:
            for entry, value in zip(self._entries, self._layout.unpack_from(data), strict=True):
                try:
                    entry.take(value)
                except SdoAbort:
                    continue
            return
        packed = int.from_bytes(data, "little")
        for field in self.fields:
            raw = (packed & (1 << field.bits) - 1).to_bytes((field.bits + 7) // 8, "little")
            packed >>= field.bits
            if field.entry is not None:
                with suppress(SdoAbort):
                    field.entry.write(raw)


def _layout(fields: tuple[Field, ...]) -> struct.Struct | None:
    """Return the fields as one struct, `None` where they are not all integers of 1, 2, 4 or 8 bytes."""
    codes = ""
    for field in fields:
        data_type = None if field.entry is None else field.entry.data_type
        if data_type is None or data_type.bits != field.bits:
            return None
        code = _CODES.get((data_type.kind, field.bits))
        if code is None:
            return None
        codes += code
    return struct.Struct(f"<{codes}")
