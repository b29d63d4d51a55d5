"""The living object dictionary of a device: values with their type, access and limits (CiA 301 §7.4)."""

import struct
from collections.abc import Callable, Iterator

from canopen.objectdictionary import ODVariable

from eds.datatypes import DATA_TYPES
from eds.description import Description
from hil_sim.node.abort import AbortCode, SdoAbort

Value = int | float | str | bytes
Key = tuple[int, int]

_REAL_FORMATS = {32: "<f", 64: "<d"}


class Entry:
    """One object: `value`, or what `source` says when the value is made at the moment of reading.

    `on_write` is asked before a new value is taken and may raise `SdoAbort`.
    """

    __slots__ = (
        "access",
        "bits",
        "default",
        "high",
        "key",
        "kind",
        "low",
        "mappable",
        "on_write",
        "source",
        "value",
    )

    def __init__(self, variable: ODVariable) -> None:
        data_type = DATA_TYPES[variable.data_type or 0x07]
        self.key: Key = (variable.index, variable.subindex)
        self.kind = data_type.kind
        self.bits = data_type.bits
        self.access = variable.access_type.lower()
        self.mappable = bool(variable.pdo_mappable)
        self.low = variable.min
        self.high = variable.max
        self.default: Value = self._default(variable.default)
        self.value: Value = self.default
        self.source: Callable[[], Value] | None = None
        self.on_write: Callable[[Value], None] | None = None

    def _default(self, given: Value | None) -> Value:
        if given is not None:
            return given
        empty: dict[str, Value] = {"text": "", "bytes": b"", "real": 0.0}
        return empty.get(self.kind, 0)

    @property
    def size(self) -> int | None:
        """Bytes of a value, `None` where the length varies."""
        return None if self.bits is None else (self.bits + 7) // 8

    @property
    def readable(self) -> bool:
        return self.access != "wo"

    @property
    def writable(self) -> bool:
        return self.access not in ("ro", "const")

    def get(self) -> Value:
        return self.value if self.source is None else self.source()

    def number(self) -> int:
        """The value of an object that holds an integer."""
        value = self.get()
        if not isinstance(value, int):
            raise TypeError(f"object {self.key[0]:04X}h:{self.key[1]} holds no integer")
        return value

    def encode(self) -> bytes:
        """The value as it travels: little-endian, integers saturated to their type."""
        value = self.get()
        if isinstance(value, bytes):
            return value
        if isinstance(value, str):
            return value.encode("latin-1", errors="replace")
        if self.kind == "real":
            return struct.pack(_REAL_FORMATS[self.bits or 32], value)
        return self._saturate(int(value)).to_bytes(self.size or 4, "little", signed=self.kind == "signed")

    def _saturate(self, value: int) -> int:
        bits = self.bits or 32
        signed = self.kind == "signed"
        low = -(1 << bits - 1) if signed else 0
        high = (1 << (bits - 1 if signed else bits)) - 1
        return min(max(value, low), high)

    def decode(self, data: bytes) -> Value:
        """A value from the wire; raises `SdoAbort` on the wrong length."""
        if self.size is not None and len(data) != self.size:
            raise SdoAbort(AbortCode.TOO_LONG if len(data) > self.size else AbortCode.TOO_SHORT)
        if self.kind == "text":
            return data.decode("latin-1")
        if self.kind == "bytes":
            return data
        if self.kind == "real":
            (value,) = struct.unpack(_REAL_FORMATS[self.bits or 32], data)
            return float(value)
        return int.from_bytes(data, "little", signed=self.kind == "signed")

    def write(self, data: bytes) -> None:
        """Take a value from the wire after every check that a device makes; raises `SdoAbort`."""
        value = self.decode(data)
        if not isinstance(value, str | bytes):
            if self.high is not None and value > self.high:
                raise SdoAbort(AbortCode.TOO_HIGH)
            if self.low is not None and value < self.low:
                raise SdoAbort(AbortCode.TOO_LOW)
        if self.on_write is not None:
            self.on_write(value)
        self.value = value


class Dictionary:
    """All objects of one device."""

    def __init__(self, description: Description) -> None:
        self._entries: dict[Key, Entry] = {}
        for item in description.object_dictionary.values():
            members = [item] if isinstance(item, ODVariable) else item.subindices.values()
            for variable in members:
                self._entries[variable.index, variable.subindex] = Entry(variable)
        self._indices = frozenset(index for index, _ in self._entries)

    def __getitem__(self, key: Key) -> Entry:
        return self._entries[key]

    def __contains__(self, key: Key) -> bool:
        return key in self._entries

    def __iter__(self) -> Iterator[Entry]:
        return iter(self._entries.values())

    def members(self, index: int) -> list[Entry]:
        """The entries of one object, sub-index 0 first; empty where the device has none."""
        return [self._entries[key] for key in sorted(self._entries) if key[0] == index]

    def indices(self, first: int, last: int) -> list[int]:
        """The objects from `first` to `last` that the device has."""
        return sorted(index for index in self._indices if first <= index <= last)

    def find(self, index: int, subindex: int) -> Entry:
        """The object of an SDO request; raises `SdoAbort` where there is none."""
        if index not in self._indices:
            raise SdoAbort(AbortCode.NO_SUCH_OBJECT)
        entry = self._entries.get((index, subindex))
        if entry is None:
            raise SdoAbort(AbortCode.NO_SUCH_SUBINDEX)
        return entry

    def read(self, index: int, subindex: int) -> bytes:
        """What an SDO upload gives; raises `SdoAbort`."""
        entry = self.find(index, subindex)
        if not entry.readable:
            raise SdoAbort(AbortCode.WRITE_ONLY)
        return entry.encode()

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """What an SDO download does; raises `SdoAbort`."""
        entry = self.find(index, subindex)
        if not entry.writable:
            raise SdoAbort(AbortCode.READ_ONLY)
        entry.write(data)
