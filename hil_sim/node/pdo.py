"""PDOs of a device: mapping, transmission types, timers, all from its dictionary (CiA 301 §7.2.2)."""

from collections.abc import Callable
from contextlib import suppress

from hil_sim.clock import MILLISECOND_NS, Clock, Event
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Dictionary, Entry, Key, Value

RPDO_COMMUNICATION, RPDO_MAPPING = 0x1400, 0x1600
TPDO_COMMUNICATION, TPDO_MAPPING = 0x1800, 0x1A00
PDO_COUNT = 0x200

_INVALID = 1 << 31
_COB_ID = 0x7FF
_SYNCHRONOUS = range(241)
_REMOTE_ONLY = (252, 253)
_EVENT_DRIVEN = (254, 255)
_INHIBIT_UNIT_NS = 100_000
_FIRST_REAL_OBJECT = 0x20  # below are dummy entries: data types that only take room


class Mapping:
    """The objects of one PDO, in the order of their bits."""

    def __init__(self, dictionary: Dictionary, index: int) -> None:
        count = dictionary[index, 0].number()
        fields = [unpack_mapping(dictionary[index, number].number()) for number in range(1, count + 1)]
        self._fields = [(_mapped(dictionary, key), bits) for key, bits in fields]
        self.keys = frozenset(key for key, _ in fields)
        self.length = (sum(bits for _, bits in fields) + 7) // 8

    def pack(self) -> bytes:
        packed, shift = 0, 0
        for entry, bits in self._fields:
            if entry is not None:
                packed |= (int.from_bytes(entry.encode(), "little") & (1 << bits) - 1) << shift
            shift += bits
        return packed.to_bytes(self.length, "little")

    def unpack(self, data: bytes) -> None:
        """Write the values into the dictionary; one that is refused leaves its object as it was."""
        packed = int.from_bytes(data, "little")
        for entry, bits in self._fields:
            raw = (packed & (1 << bits) - 1).to_bytes((bits + 7) // 8, "little")
            packed >>= bits
            if entry is not None:
                with suppress(SdoAbort):
                    entry.write(raw)


def unpack_mapping(value: int) -> tuple[Key, int]:
    """A mapping entry as object and length in bits."""
    return (value >> 16, value >> 8 & 0xFF), value & 0xFF


def _mapped(dictionary: Dictionary, key: Key) -> Entry | None:
    return None if key[0] < _FIRST_REAL_OBJECT else dictionary[key]


class Tpdo:
    """One PDO that the device sends."""

    def __init__(
        self, clock: Clock, dictionary: Dictionary, number: int, send: Callable[[int, bytes], None]
    ) -> None:
        self._clock = clock
        self._send = send
        communication = {
            entry.key[1]: entry.number() for entry in dictionary.members(TPDO_COMMUNICATION + number)
        }
        cob_id = communication[1]
        self.valid = not cob_id & _INVALID
        self.cob_id = cob_id & _COB_ID
        self.transmission_type = communication[2]
        self._inhibit_ns = communication.get(3, 0) * _INHIBIT_UNIT_NS
        self._event_ns = communication.get(5, 0) * MILLISECOND_NS
        self._mapping = Mapping(dictionary, TPDO_MAPPING + number)
        self._syncs = 0
        self._changed = False
        self._timer: Event | None = None
        self._inhibited: Event | None = None

    def start(self) -> None:
        """The device became operational: event-driven PDOs show themselves once (CiA 301 §7.2.2.2)."""
        if self.valid and self.transmission_type in _EVENT_DRIVEN:
            self.transmit()

    def stop(self) -> None:
        for event in (self._timer, self._inhibited):
            if event is not None:
                event.cancel()
        self._timer = self._inhibited = None

    def synchronise(self) -> None:
        """A SYNC came."""
        kind = self.transmission_type
        if not self.valid or kind not in _SYNCHRONOUS:
            return
        self._syncs += 1
        if self._changed if kind == 0 else self._syncs >= kind:
            self.transmit()

    def changed(self, key: Key) -> None:
        """An object has changed of which the application says so."""
        if key in self._mapping.keys:
            self._changed = True
            if self.valid and self.transmission_type in _EVENT_DRIVEN and self._inhibited is None:
                self.transmit()

    def requested(self) -> None:
        """A remote frame asked for it."""
        if self.valid:
            self.transmit()

    def transmit(self) -> None:
        self.stop()
        self._syncs = 0
        self._changed = False
        self._send(self.cob_id, self._mapping.pack())
        if self.transmission_type in _EVENT_DRIVEN:
            if self._event_ns:
                self._timer = self._clock.after(self._event_ns, self.transmit)
            if self._inhibit_ns:
                self._inhibited = self._clock.after(self._inhibit_ns, self._inhibit_over)

    def _inhibit_over(self) -> None:
        self._inhibited = None
        if self._changed:
            self.transmit()


class Rpdo:
    """One PDO that the device receives; a synchronous one takes effect with the next SYNC."""

    def __init__(self, dictionary: Dictionary, number: int, too_short: Callable[[], None]) -> None:
        cob_id = dictionary[RPDO_COMMUNICATION + number, 1].number()
        self.valid = not cob_id & _INVALID
        self.cob_id = cob_id & _COB_ID
        self.transmission_type = dictionary[RPDO_COMMUNICATION + number, 2].number()
        self._mapping = Mapping(dictionary, RPDO_MAPPING + number)
        self._too_short = too_short
        self._waiting: bytes | None = None

    def receive(self, data: bytes) -> None:
        if len(data) < self._mapping.length:
            self._too_short()
        elif self.transmission_type in _SYNCHRONOUS:
            self._waiting = data
        else:
            self._mapping.unpack(data)

    def synchronise(self) -> None:
        if self._waiting is not None:
            data, self._waiting = self._waiting, None
            self._mapping.unpack(data)


def guard_configuration(dictionary: Dictionary, reload: Callable[[], None]) -> None:
    """Let SDO clients change PDOs only as CiA 301 §7.5.2.36 says, and call `reload` after each change.

    A mapping changes while its number of objects is 0; that number then says whether the mapping can be.
    """
    for first in (RPDO_MAPPING, TPDO_MAPPING):
        for index in dictionary.indices(first, first + PDO_COUNT - 1):
            count, *slots = dictionary.members(index)
            count.on_write = _count_check(dictionary, index, reload)
            for slot in slots:
                slot.on_write = _slot_check(dictionary, count)
    for first in (RPDO_COMMUNICATION, TPDO_COMMUNICATION):
        for index in dictionary.indices(first, first + PDO_COUNT - 1):
            for entry in dictionary.members(index)[1:]:
                entry.on_write = lambda _: reload()


def _slot_check(dictionary: Dictionary, count: Entry) -> Callable[[Value], None]:
    def check(value: Value) -> None:
        if count.value != 0:
            raise SdoAbort(AbortCode.UNSUPPORTED_ACCESS)
        key, bits = unpack_mapping(int(value))
        if not value or key[0] < _FIRST_REAL_OBJECT:
            return
        entry = dictionary.find(*key)
        if not entry.mappable or entry.bits != bits:
            raise SdoAbort(AbortCode.NOT_MAPPABLE)

    return check


def _count_check(dictionary: Dictionary, index: int, reload: Callable[[], None]) -> Callable[[Value], None]:
    def check(value: Value) -> None:
        slots = [dictionary[index, number].number() for number in range(1, int(value) + 1)]
        if any(not slot for slot in slots):
            raise SdoAbort(AbortCode.NOT_MAPPABLE)
        if sum(unpack_mapping(slot)[1] for slot in slots) > 64:
            raise SdoAbort(AbortCode.PDO_TOO_LONG)
        reload()

    return check
