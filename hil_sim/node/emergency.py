"""Emergencies: EMCY message, error register 1001h and error history 1003h (CiA 301 §7.2.7)."""

from collections.abc import Callable

from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Dictionary, Value

ERROR_REGISTER = (0x1001, 0)
HISTORY = 0x1003
COB_ID = (0x1014, 0)
GENERIC = 0x01

_COB_ID_INVALID = 1 << 31

# Bits of the error register by the class of the error code (CiA 301 tables 26 and 49).
_REGISTER_BITS = {0x2: 0x02, 0x3: 0x04, 0x4: 0x08, 0x8: 0x10}
_DEVICE_PROFILE_BIT = 0x20


class Emergencies:
    """The errors a device has now, and those it remembers."""

    def __init__(self, dictionary: Dictionary, send: Callable[[int, bytes], None]) -> None:
        self._dictionary = dictionary
        self._send = send
        self._active: dict[int, int] = {}
        self._history: list[int] = []
        dictionary[ERROR_REGISTER].source = self._register
        for entry in dictionary.members(HISTORY):
            entry.source = self._history_source(entry.key[1])
        dictionary[HISTORY, 0].on_write = self._clear_history

    def reset(self) -> None:
        """Forget the active errors without a word; the history stays until it is cleared or power is gone."""
        self._active.clear()

    def occurred(self, code: int, vendor: bytes = b"") -> None:
        """An error begins: register, history and message."""
        if code in self._active:
            return
        self._active[code] = GENERIC | self._register_bit(code)
        self._history = [code, *self._history][: len(self._dictionary.members(HISTORY)) - 1]
        self._transmit(code, vendor)

    def ended(self, code: int) -> None:
        """An error is over; the last one that ends says so with code 0000h."""
        if self._active.pop(code, None) is not None:
            self._transmit(0x0000, b"")

    def end_all(self) -> None:
        for code in tuple(self._active):
            self.ended(code)

    def _transmit(self, code: int, vendor: bytes) -> None:
        cob_id = self._dictionary[COB_ID].number()
        if not cob_id & _COB_ID_INVALID:
            self._send(
                cob_id & 0x7FF,
                code.to_bytes(2, "little") + bytes([self._register()]) + vendor.ljust(5, b"\0"),
            )

    def _register(self) -> int:
        register = 0
        for bits in self._active.values():
            register |= bits
        return register

    def _register_bit(self, code: int) -> int:
        return (
            _DEVICE_PROFILE_BIT
            if code >> 8 in (0x84, 0x85, 0x86, 0x87)
            else _REGISTER_BITS.get(code >> 12, 0)
        )

    def _history_source(self, subindex: int) -> Callable[[], Value]:
        if subindex == 0:
            return lambda: len(self._history)
        return lambda: self._history[subindex - 1] if subindex <= len(self._history) else 0

    def _clear_history(self, value: Value) -> None:
        if value != 0:
            raise SdoAbort(AbortCode.TOO_HIGH)
        self._history.clear()
