"""Devices of a recording: their frames are played, and their SDO servers answer so that a gateway comes up.

A device answers what was recorded of it: in SDO transfers of others (expedited ones), in PDOs by its mapping,
1001h in EMCY messages. Of the rest it answers what its EDS or DCF gives, but for measured values: those were
not seen, and it says so (0800 0024h, no data available). It refuses every write (0800 0022h).
"""

from contextlib import suppress

from eds.description import Description
from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.node import cob_id, pdo
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.coding import decode
from hil_sim.node.dictionary import Dictionary, Entry, Key
from hil_sim.node.emergency import ERROR_REGISTER
from hil_sim.node.pdo_mapping import Mapping
from hil_sim.node.sdo_channel import SdoChannels

SDO_REQUEST, SDO_ANSWER = 0x600, 0x580  # CiA 301 §7.3.5, by node id
_EMCY = 0x80
# The other identifiers of the predefined connection set on which a node sends: TPDO 1–4, heartbeat.
_SENT = (_EMCY, 0x180, 0x280, 0x380, 0x480, SDO_ANSWER, 0x700)
_UPLOADED, _DOWNLOADED, _DOWNLOAD = 2, 3, 1  # command specifiers
_EXPEDITED, _SIZED = 0x02, 0x01
_PDO_OBJECTS = range(pdo.RPDO_COMMUNICATION, 0x1C00)


def seen(identifiers: set[int]) -> set[int]:
    """Return the node ids of those who sent on these identifiers (11 bits)."""
    return {node for node in range(1, 128) if any(base + node in identifiers for base in _SENT)}


class RecordedDictionary(Dictionary):
    """Knowledge about a device; `recorded` are the objects whose value was in the recording."""

    def __init__(self, description: Description) -> None:
        super().__init__(description)
        self.recorded: set[Key] = set()

    def read(self, index: int, subindex: int) -> bytes:
        entry = self.find(index, subindex)
        if entry.key not in self.recorded and not _known_from_file(entry):
            raise SdoAbort(AbortCode.NO_DATA)
        return super().read(index, subindex)

    def find_writable(self, index: int, subindex: int) -> Entry:
        super().find_writable(index, subindex)
        raise SdoAbort(AbortCode.WRONG_STATE)

    def learn(self, key: Key, data: bytes) -> None:
        """Take an object's value from the recording."""
        entry = self.get(key)
        if entry is not None:
            with suppress(SdoAbort):  # not of the length that the file says
                entry.value = decode(entry.data_type, data)
                self.recorded.add(key)


def _known_from_file(entry: Entry) -> bool:
    measured = entry.mappable and not entry.writable and entry.access != "const"
    return not measured and (entry.described or bool(entry.value))


class RecordedNode:
    """One device on `bus`; `sdo` are the frames of its SDO channel in the whole recording.

    It begins with the first value that they show of each object. `player` plays its other frames.
    """

    def __init__(
        self, bus: CanBus, node_id: int, description: Description, sdo: list[Frame], player: object
    ) -> None:
        self.node_id = node_id
        self.dictionary = RecordedDictionary(description)
        self._bus = bus
        self._player = player
        self._asked = bytes(8)
        for key, data in reversed([shown for frame in sdo if (shown := self._shown(frame)) is not None]):
            self.dictionary.learn(key, data)
        self._pdos = self._mappings()
        channels = SdoChannels(bus.clock, self.dictionary, lambda: node_id, self._send, lambda: None)
        self._servers = {channel.request: channel.server for channel in channels.channels()}
        bus.attach(self, self._receive)

    def overheard(self, frame: Frame) -> None:
        """Take somebody else's SDO frame of the recording: not played, but its value counts from now on."""
        shown = self._shown(frame)
        if shown is not None:
            self.dictionary.learn(*shown)
            if shown[0][0] in _PDO_OBJECTS:
                self._pdos = self._mappings()

    def _shown(self, frame: Frame) -> tuple[Key, bytes] | None:
        """Return an object's value, read or confirmed as written by an expedited transfer."""
        data = frame.data
        if len(data) != 8:
            return None
        if frame.cob_id == SDO_REQUEST + self.node_id:
            self._asked = data
            return None
        asked, command = self._asked, data[0] >> 5
        if command == _DOWNLOADED and asked[0] >> 5 == _DOWNLOAD and asked[1:4] == data[1:4]:
            return _expedited(asked)
        return _expedited(data) if command == _UPLOADED else None

    def _mappings(self) -> dict[int, Mapping]:
        """Return each PDO's mapping by its identifier."""
        numbers = self.dictionary.number
        found: dict[int, Mapping] = {}
        for communication, mapping in (
            (pdo.RPDO_COMMUNICATION, pdo.RPDO_MAPPING),
            (pdo.TPDO_COMMUNICATION, pdo.TPDO_MAPPING),
        ):
            for index in self.dictionary.indices(communication, communication + 0x1FF):
                identifier = numbers((index, pdo.COB_ID), cob_id.INVALID)
                if cob_id.is_valid(identifier):
                    mapped = Mapping.current(self.dictionary, mapping + index - communication)
                    found[identifier & cob_id.IDENTIFIER] = mapped
        return found

    def _send(self, identifier: int, data: bytes) -> None:
        self._bus.send(Frame(identifier, data), self)

    def _receive(self, frame: Frame, sender: object) -> None:
        if frame.extended or frame.remote:
            return
        if sender is self._player:
            self._watch(frame)
        elif frame.cob_id in self._servers:
            self._servers[frame.cob_id].receive(frame.data)

    def _watch(self, frame: Frame) -> None:
        mapping = self._pdos.get(frame.cob_id)
        if mapping is not None and len(frame.data) >= mapping.length:
            mapping.unpack(frame.data)
            self.dictionary.recorded |= mapping.keys
        elif frame.cob_id == _EMCY + self.node_id and len(frame.data) == 8:
            self.dictionary.learn(ERROR_REGISTER, frame.data[2:3])


def _expedited(data: bytes) -> tuple[Key, bytes] | None:
    if not data[0] & _EXPEDITED:
        return None
    size = 4 - (data[0] >> 2 & 3) if data[0] & _SIZED else 4
    return (int.from_bytes(data[1:3], "little"), data[3]), data[4 : 4 + size]
