"""Store and restore of parameters: 1010h, 1011h (CiA 301 §7.5.2.13, §7.5.2.14), and what LSS stores."""

from contextlib import suppress

from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.coding import decode, encode
from hil_sim.node.dictionary import Dictionary, Entry, Value
from hil_sim.node.memory import Kept, Memory, ProcessMemory

STORE, RESTORE = 0x1010, 0x1011
_SAVE_SIGNATURE = int.from_bytes(b"save", "little")
_LOAD_SIGNATURE = int.from_bytes(b"load", "little")
_ON_COMMAND = 1  # what both objects read as: the device stores, and can restore, on command alone

EVERYTHING = range(0x1000, 0x10000)
COMMUNICATION = range(0x1000, 0x2000)
MANUFACTURER = range(0x2000, 0x6000)
APPLICATION = range(0x6000, 0xA000)
_LSS_NODE_ID, _LSS_BITRATE = (0, 1), (0, 2)  # among what is kept: index 0 is no object, and no group of any
_GROUPS = {1: EVERYTHING, 2: COMMUNICATION, 3: APPLICATION}  # by sub-index; above are the manufacturer's


class Storage:
    """The parameters of a device, and what its `memory` keeps of them without power.

    A parameter is what can be written, and is not made at the moment of reading.
    """

    def __init__(self, dictionary: Dictionary) -> None:
        self.memory: Memory = ProcessMemory()
        self._dictionary = dictionary
        self._kept: Kept = {}
        for entry in (*dictionary.members(STORE)[1:], *dictionary.members(RESTORE)[1:]):
            self._command(entry)

    def load(self) -> None:
        """Restore the memory at power-on, or the values of a DCF."""
        kept = self.memory.load()
        self._kept = self._commissioned() if kept is None else kept

    def restore(self, objects: range) -> None:
        """Give the parameters in `objects` the values they have after a reset."""
        for entry in self._parameters(objects):
            entry.value = entry.default
            if entry.key in self._kept:
                with suppress(SdoAbort):  # kept by an older description of the device
                    entry.value = decode(entry.data_type, self._kept[entry.key])

    def layer_settings(self, node_id: int, bitrate: int) -> tuple[int, int]:
        """Return node id and bit rate as LSS has stored them; those given where it never did."""
        kept = (self._kept.get(_LSS_NODE_ID), self._kept.get(_LSS_BITRATE))
        numbers = [None if data is None else int.from_bytes(data, "little") for data in kept]
        return numbers[0] or node_id, numbers[1] or bitrate

    def keep_layer_settings(self, node_id: int, bitrate: int) -> None:
        """Store them (CiA 305); raises `OSError` where they cannot be."""
        given = {_LSS_NODE_ID: bytes([node_id]), _LSS_BITRATE: bitrate.to_bytes(4, "little")}
        self._keep({**self._kept, **given})

    def _parameters(self, objects: range) -> list[Entry]:
        return [
            entry
            for entry in self._dictionary
            if entry.key[0] in objects and entry.readable and entry.writable and entry.source is None
        ]

    def _commissioned(self) -> Kept:
        return {
            entry.key: encode(entry.data_type, entry.commissioned)
            for entry in self._parameters(EVERYTHING)
            if entry.commissioned is not None
        }

    def _command(self, entry: Entry) -> None:
        index, subindex = entry.key
        signature = _SAVE_SIGNATURE if index == STORE else _LOAD_SIGNATURE
        act = self._save if index == STORE else self._forget
        objects = _GROUPS.get(subindex, MANUFACTURER)

        def check(value: Value) -> None:
            if value != signature:
                raise SdoAbort(AbortCode.NOT_STORABLE)
            try:
                act(objects)
            except OSError as error:
                raise SdoAbort(AbortCode.HARDWARE_ERROR) from error

        entry.source = lambda: _ON_COMMAND
        entry.on_write = check

    def _save(self, objects: range) -> None:
        self._keep({**self._kept, **{entry.key: entry.encode() for entry in self._parameters(objects)}})

    def _forget(self, objects: range) -> None:
        self._keep({key: value for key, value in self._kept.items() if key[0] not in objects})

    def _keep(self, kept: Kept) -> None:
        self.memory.save(kept)
        self._kept = kept
