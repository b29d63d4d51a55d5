"""Emergencies: EMCY message, error register 1001h and error history 1003h (CiA 301 §7.2.7)."""

from collections import deque
from collections.abc import Callable

from hil_sim.clock import Clock, Event
from hil_sim.node import cob_id
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Dictionary, Value

ERROR_REGISTER = (0x1001, 0)
HISTORY = 0x1003
COB_ID = (0x1014, 0)
INHIBIT_TIME = (0x1015, 0)
INHIBIT_UNIT_NS = 100_000

ALL_ERRORS = range(0x10000)
COMMUNICATION_ERRORS = range(0x8100, 0x8300)

_GENERIC = 0x01
_COMMUNICATION = 0x10
_DEVICE_PROFILE = 0x20
_MANUFACTURER = 0x80

# Bits of the error register by the error code's first byte, else by its first digit (CiA 301 tables 26, 49).
_REGISTER_BITS = {
    0x81: _COMMUNICATION,
    0x82: _COMMUNICATION,
    **dict.fromkeys(range(0x83, 0x88), _DEVICE_PROFILE),  # torque, velocity, position, … control (CiA 402-2)
    0xFF: _MANUFACTURER,
}
_REGISTER_BITS_BY_CLASS = {0x2: 0x02, 0x3: 0x04, 0x4: 0x08}

_Error = tuple[int, bytes]


class Emergencies:
    """The errors a device has now, and those it remembers.

    `send` is told COB-ID and message, and may be called only while `may_send`.
    """

    def __init__(
        self,
        clock: Clock,
        dictionary: Dictionary,
        send: Callable[[int, bytes], None],
        may_send: Callable[[], bool],
    ) -> None:
        self._clock = clock
        self._dictionary = dictionary
        self._send = send
        self._may_send = may_send
        self._active: dict[_Error, int] = {}
        self._history: list[int] = []
        self._waiting: deque[bytes] = deque()
        self._inhibited: Event | None = None
        self._bind()

    def _bind(self) -> None:
        dictionary = self._dictionary
        if ERROR_REGISTER in dictionary:
            dictionary[ERROR_REGISTER].source = self._register
        for entry in dictionary.members(HISTORY):
            entry.source = self._history_source(entry.key[1])
        if (HISTORY, 0) in dictionary:
            count = dictionary[HISTORY, 0]
            count.low = count.high = None  # the standard says how other values than 0 are refused
            count.on_write = self._clear_history
        if COB_ID in dictionary:
            dictionary[COB_ID].on_write = cob_id.guard(dictionary[COB_ID])

    def forget(self) -> None:
        """Clear errors and history at power-on."""
        self._active.clear()
        self._history.clear()

    def reset(self, codes: range) -> None:
        """Forget the active errors with these codes without a word; the history stays."""
        self._active = {error: bits for error, bits in self._active.items() if error[0] not in codes}

    def silence(self) -> None:
        """Forget the messages that wait for the inhibit time."""
        self._waiting.clear()
        if self._inhibited is not None:
            self._inhibited.cancel()
            self._inhibited = None

    def occurred(self, code: int, vendor: bytes = b"") -> None:
        """Begin an error: register, history and message. `vendor` tells errors of one code apart."""
        if (code, vendor) in self._active:
            return
        by_class = _REGISTER_BITS_BY_CLASS.get(code >> 12, 0)
        self._active[code, vendor] = _GENERIC | _REGISTER_BITS.get(code >> 8, by_class)
        room = max(len(self._dictionary.members(HISTORY)) - 1, 0)
        self._history = [code, *self._history][:room]
        self._transmit(code, vendor)

    def ended(self, code: int, vendor: bytes = b"") -> None:
        """End an error: code 0000h, with the remaining errors in the register."""
        if self._active.pop((code, vendor), None) is not None:
            self._transmit(0x0000, b"")

    def end_all(self) -> None:
        for code, vendor in tuple(self._active):
            self.ended(code, vendor)

    # -- messages ----------------------------------------------------------------------------------------

    def _transmit(self, code: int, vendor: bytes) -> None:
        if self._may_send() and COB_ID in self._dictionary:
            message = code.to_bytes(2, "little") + bytes([self._register()]) + vendor.ljust(5, b"\0")
            self._waiting.append(message)
            self._send_waiting()

    def _send_waiting(self) -> None:
        identifier = self._dictionary[COB_ID].number()
        while self._waiting and self._inhibited is None:
            message = self._waiting.popleft()
            if cob_id.is_valid(identifier):
                self._send(identifier & cob_id.IDENTIFIER, message)
                self._inhibit()

    def _inhibit(self) -> None:
        inhibit_ns = self._dictionary.number(INHIBIT_TIME) * INHIBIT_UNIT_NS
        if inhibit_ns:
            self._inhibited = self._clock.after(inhibit_ns, self._inhibit_over)

    def _inhibit_over(self) -> None:
        self._inhibited = None
        self._send_waiting()

    # -- objects -----------------------------------------------------------------------------------------

    def _register(self) -> int:
        register = 0
        for bits in self._active.values():
            register |= bits
        return register

    def _history_source(self, subindex: int) -> Callable[[], Value]:
        def error() -> Value:
            if subindex > len(self._history):
                raise SdoAbort(AbortCode.NO_DATA)
            return self._history[subindex - 1]

        return error if subindex else lambda: len(self._history)

    def _clear_history(self, value: Value) -> None:
        if value != 0:
            raise SdoAbort(AbortCode.INVALID_VALUE)
        self._history.clear()
