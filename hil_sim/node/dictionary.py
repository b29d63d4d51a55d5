"""The living object dictionary of a device: values with their type, access and limits (CiA 301 §7.4)."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from eds.datatypes import DATA_TYPES
from eds.description import Description
from hil_sim.node import coding
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.coding import Value as Value

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

Key = tuple[int, int]

IDENTITY = 0x1018

_NUMBERS = (int, float)
_FIRST_OBJECT = 0x20  # below are data types, which only take room in a PDO


class Entry:
    """One object: `value`, or what `source` says when the value is made at the moment of reading.

    `on_write` is asked before a new value is taken and may raise `SdoAbort`; `on_written` is told after.
    `described` says whether the file gives a value at all.
    """

    __slots__ = (
        "access",
        "commissioned",
        "data_type",
        "default",
        "described",
        "high",
        "key",
        "low",
        "mappable",
        "on_write",
        "on_written",
        "source",
        "value",
    )

    def __init__(self, variable: "ODVariable") -> None:
        self.key: Key = (variable.index, variable.subindex)
        self.data_type = DATA_TYPES[variable.data_type or 0x07]
        self.access = variable.access_type.lower()
        self.mappable = bool(variable.pdo_mappable)
        self.low, self.high = variable.min, variable.max
        if self.data_type.kind == "boolean":
            self.low, self.high = 0, 1
        given: Value | None = variable.default
        self.commissioned: Value | None = variable.value  # what a DCF sets the device to
        self.described = (given, self.commissioned) != (None, None)
        self.default: Value = coding.empty(self.data_type) if given is None else given
        self.value: Value = self.default if self.commissioned is None else self.commissioned
        self.source: Callable[[], Value] | None = None
        self.on_write: Callable[[Value], None] | None = None
        self.on_written: Callable[[], None] | None = None

    @property
    def readable(self) -> bool:
        return self.access != "wo"

    @property
    def writable(self) -> bool:
        return self.access not in ("ro", "const")

    def get(self) -> Value:
        return self.value if self.source is None else self.source()

    def number(self) -> int:
        """Return the value of an object that holds an integer."""
        value = self.value if self.source is None else self.source()
        if not isinstance(value, int):
            raise TypeError(f"object {self.key[0]:04X}h:{self.key[1]} holds no integer")
        return value

    def encode(self) -> bytes:
        """Return the value as it travels."""
        return coding.encode(self.data_type, self.get())

    def write(self, data: bytes) -> None:
        """Take a value from the wire after every check that a device makes; raises `SdoAbort`."""
        self.take(coding.decode(self.data_type, data))

    def take(self, value: Value) -> None:
        """Take a value of the object's type, likewise."""
        low, high = self.low, self.high
        if not (low is None and high is None) and isinstance(value, _NUMBERS):
            if high is not None and value > high:
                raise SdoAbort(AbortCode.TOO_HIGH)
            if low is not None and value < low:
                raise SdoAbort(AbortCode.TOO_LOW)
        if self.on_write is not None:
            self.on_write(value)
        self.value = value
        if self.on_written is not None:
            self.on_written()


class Dictionary:
    """All objects of one device; `dummies` are the data types that a PDO may map to take room."""

    def __init__(self, description: Description) -> None:
        self._entries: dict[Key, Entry] = {}
        for item in description.object_dictionary.values():
            members = getattr(item, "subindices", None)
            for variable in (item,) if members is None else members.values():
                self._entries[variable.index, variable.subindex] = Entry(variable)
        dummies = [key for key in self._entries if key[0] < _FIRST_OBJECT]
        self.dummies = {key: self._entries.pop(key).data_type.bits for key in dummies}
        self._indices = frozenset(index for index, _ in self._entries)
        self._identify(description)

    def _identify(self, description: Description) -> None:
        """Fill 1018h where only [DeviceInfo] says whose device it is."""
        for subindex, number in ((1, description.vendor_id), (2, description.product_code)):
            entry = self._entries.get((IDENTITY, subindex))
            if entry is not None and number and not entry.value:
                entry.default = entry.value = number

    def readdress(self, before: Description, after: Description) -> None:
        """Change the node id, on which defaults of the file depend."""
        for entry in self._entries.values():
            old, new = before.variable(*entry.key), after.variable(*entry.key)
            if old is None or new is None or (old.default, old.value) == (new.default, new.value):
                continue
            given: Value = entry.default if new.default is None else new.default
            if entry.value == entry.default:
                entry.value = given
            entry.default, entry.commissioned = given, new.value

    def __getitem__(self, key: Key) -> Entry:
        return self._entries[key]

    def __contains__(self, key: Key) -> bool:
        return key in self._entries

    def __iter__(self) -> Iterator[Entry]:
        return iter(self._entries.values())

    def get(self, key: Key) -> Entry | None:
        """Return the entry, `None` where the device has none."""
        return self._entries.get(key)

    def number(self, key: Key, otherwise: int = 0) -> int:
        """Return the integer that an object holds, `otherwise` where the device has no such object."""
        entry = self._entries.get(key)
        return otherwise if entry is None else entry.number()

    def members(self, index: int) -> list[Entry]:
        """Return the entries of one object, sub-index 0 first; empty where the device has none."""
        return [self._entries[key] for key in sorted(self._entries) if key[0] == index]

    def indices(self, first: int, last: int) -> list[int]:
        """Return the objects from `first` to `last` that the device has."""
        return sorted(index for index in self._indices if first <= index <= last)

    def find(self, index: int, subindex: int) -> Entry:
        """Return the object of an SDO request; raises `SdoAbort` where there is none."""
        if index not in self._indices:
            raise SdoAbort(AbortCode.NO_SUCH_OBJECT)
        entry = self._entries.get((index, subindex))
        if entry is None:
            raise SdoAbort(AbortCode.NO_SUCH_SUBINDEX)
        return entry

    def find_writable(self, index: int, subindex: int) -> Entry:
        """Return the object of an SDO download; raises `SdoAbort`."""
        entry = self.find(index, subindex)
        if not entry.writable:
            raise SdoAbort(AbortCode.READ_ONLY)
        return entry

    def read(self, index: int, subindex: int) -> bytes:
        """Return the answer to an SDO upload; raises `SdoAbort`."""
        entry = self.find(index, subindex)
        if not entry.readable:
            raise SdoAbort(AbortCode.WRITE_ONLY)
        return entry.encode()

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write by SDO download; raises `SdoAbort`."""
        self.find_writable(index, subindex).write(data)
