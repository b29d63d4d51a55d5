"""The devices of a trace: what each is called, which EDS describes it, and what its PDOs carry by now."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from drivers.bus.frames import EXTENDED
from drivers.bus.pdo import EXTENDED_ID, NOT_VALID, TPDO_MAPPING, TPDO_PARAMETER
from drivers.bus.rpdo import RPDO_MAPPING, RPDO_PARAMETER
from eds import Description
from eds.description import FIRST_OBJECT
from eds.report import MAX_MAPPED

Object = tuple[int, int]
_MOST = 512
_PDOS = (("TPDO", TPDO_PARAMETER, TPDO_MAPPING), ("RPDO", RPDO_PARAMETER, RPDO_MAPPING))
_CONFIGURATION = range(RPDO_PARAMETER, TPDO_MAPPING + _MOST)


@dataclass(frozen=True, slots=True)
class Mapped:
    """One object in a PDO: `bits` long from bit `at` on."""

    index: int
    subindex: int
    bits: int
    at: int


@dataclass(frozen=True, slots=True)
class Pdo:
    """One PDO of a device as far as it is known."""

    node_id: int
    name: str  # TPDO1
    can_id: int
    objects: tuple[Mapped, ...]


class Device:
    """One node; what is read or written of its PDOs while we listen counts more than its EDS."""

    def __init__(self, node_id: int, name: str | None = None, description: Description | None = None) -> None:
        self.node_id = node_id
        self.name = name or f"node {node_id}"
        self.description = description
        self._numbers: dict[Object, int] = dict(_configured(description)) if description else {}

    @property
    def vendor_id(self) -> int | None:
        return None if self.description is None else self.description.vendor_id

    def learn(self, index: int, subindex: int, value: bytes) -> bool:
        """Take an object's value; return whether it is new about PDOs."""
        if index not in _CONFIGURATION:
            return False
        number = int.from_bytes(value, "little")
        if self._numbers.get((index, subindex)) == number:
            return False
        self._numbers[index, subindex] = number
        return True

    def pdos(self) -> Iterator[Pdo]:
        """Yield those that are enabled, and whose mapping is known."""
        for kind, communication, mapping in _PDOS:
            for number in range(_MOST):
                cob_id = self._numbers.get((communication + number, 1))
                if cob_id is None or cob_id & NOT_VALID:
                    continue
                objects = tuple(self._objects(mapping + number))
                wide = cob_id & EXTENDED_ID
                can_id = cob_id & 0x1FFF_FFFF | EXTENDED if wide else cob_id & 0x7FF
                yield Pdo(self.node_id, f"{kind}{number + 1}", can_id, objects)

    def _objects(self, mapping: int) -> Iterator[Mapped]:
        at = 0
        for place in range(1, min(self._numbers.get((mapping, 0), 0), MAX_MAPPED) + 1):
            entry = self._numbers.get((mapping, place))
            if entry is None:  # what follows cannot be placed
                return
            yield Mapped(entry >> 16, entry >> 8 & 0xFF, entry & 0xFF, at)
            at += entry & 0xFF


def _configured(description: Description) -> Iterator[tuple[Object, int]]:
    """Yield the PDO settings of the file: a DCF's value, else the default."""
    for variable in description.variables():
        value = variable.default if variable.value is None else variable.value
        if variable.index in _CONFIGURATION and isinstance(value, int):
            yield (variable.index, variable.subindex), value


class Devices:
    """All of a bus. A node that no file names gets a number for a name."""

    def __init__(self, known: Iterable[Device] = ()) -> None:
        self._devices = {device.node_id: device for device in known}
        self._pdos: Mapping[int, tuple[Pdo, ...]] | None = None

    def __getitem__(self, node_id: int) -> Device:
        found = self._devices.get(node_id)
        if found is None:
            found = self._devices[node_id] = Device(node_id)
        return found

    def name(self, node_id: int) -> str:
        return self[node_id].name

    def learn(self, node_id: int, index: int, subindex: int, value: bytes) -> None:
        """Note that a device holds this value."""
        if index >= FIRST_OBJECT and self[node_id].learn(index, subindex, value):
            self._pdos = None

    def pdo(self, can_id: int, *, commanded: bool) -> tuple[Pdo | None, tuple[int, ...]]:
        """Return the PDO that an identifier carries, and the nodes that take it.

        Of a frame that commands, the receiver's objects say more than the sender's.
        """
        if self._pdos is None:
            self._pdos = self._by_identifier()
        known = self._pdos.get(can_id, ())
        sent = next((pdo for pdo in known if pdo.name[0] == "T"), None)
        taken = [pdo for pdo in known if pdo.name[0] == "R"]
        receivers = tuple(pdo.node_id for pdo in taken)
        if taken and (commanded or sent is None):
            return taken[0], receivers
        return sent, receivers

    def _by_identifier(self) -> dict[int, tuple[Pdo, ...]]:
        found: dict[int, tuple[Pdo, ...]] = {}
        for device in self._devices.values():
            for pdo in device.pdos():
                found[pdo.can_id] = (*found.get(pdo.can_id, ()), pdo)
        return found
