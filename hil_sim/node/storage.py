"""Store and restore of parameters: 1010h, 1011h (CiA 301 §7.5.2.13, §7.5.2.14)."""

from collections.abc import Callable

from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Dictionary, Entry, Key, Value

STORE = (0x1010, 1)
RESTORE = (0x1011, 1)
_SAVE_SIGNATURE = int.from_bytes(b"save", "little")
_LOAD_SIGNATURE = int.from_bytes(b"load", "little")
_ON_COMMAND = 1  # what both objects read as: the device stores on command

COMMUNICATION = range(0x1000, 0x2000)
EVERYTHING = range(0x1000, 0xFFFF)


class Storage:
    """What the device keeps over a reset: the defaults, or what was stored last."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._parameters = [entry for entry in dictionary if entry.access == "rw" and entry.source is None]
        self._stored: dict[Key, Value] = {}
        for key, signature, action in (
            (STORE, _SAVE_SIGNATURE, self._save),
            (RESTORE, _LOAD_SIGNATURE, self._stored.clear),
        ):
            if key in dictionary:
                self._commanded(dictionary[key], signature, action)

    def restore(self, objects: range) -> None:
        """Give the parameters in `objects` the values they have after a reset."""
        for entry in self._parameters:
            if entry.key[0] in objects and entry.source is None:
                entry.value = self._stored.get(entry.key, entry.default)

    def _save(self) -> None:
        self._stored.update({entry.key: entry.value for entry in self._parameters if entry.source is None})

    def _commanded(self, entry: Entry, signature: int, action: Callable[[], None]) -> None:
        def check(value: Value) -> None:
            if value != signature:
                raise SdoAbort(AbortCode.NOT_STORABLE)
            action()

        entry.source = lambda: _ON_COMMAND
        entry.on_write = check
