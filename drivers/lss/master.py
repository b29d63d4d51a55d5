"""The master's side of CiA 305, request by request; an answer to another request is none.

python-canopen has an LssMaster. It takes any frame of 7E4h for the answer to whatever it has asked last,
sleeps 0.2 s between the four numbers of an identity, tells no error code, and needs a bus of its own.
"""

import queue
import time
from dataclasses import astuple, dataclass
from typing import Protocol, Self

from drivers.bus.frames import FrameHandler
from drivers.errors import DeviceTimeout, LssRefusal, Mismatch, SettingsError
from drivers.inbox import Inbox

REQUEST, ANSWER = 0x7E5, 0x7E4
UNCONFIGURED = 255
# CiA 305, table 0 of bit timings: bit/s → index.
BITRATES = {
    1_000_000: 0,
    800_000: 1,
    500_000: 2,
    250_000: 3,
    125_000: 4,
    50_000: 6,
    20_000: 7,
    10_000: 8,
}
TIMEOUT_S = 0.5
SCAN_S = 0.05  # for an answer to a question of the search: half of all have none
SETTLE_S = 0.01  # after an answer, for those of others to the same question
GAP_S = 0.02  # after what nobody answers: some devices lose a request that follows at once
PARTS = ("vendor", "product", "revision", "serial number")

_SWITCH_ALL, _NODE_ID, _BIT_TIMING, _ACTIVATE, _STORE = 0x04, 0x11, 0x13, 0x15, 0x17
_SWITCH_ONE, _SWITCHED = 0x40, 0x44
_FASTSCAN, _IDENTIFIED = 0x51, 0x4F
_IDENTIFY_UNCONFIGURED, _UNCONFIGURED = 0x4C, 0x50
_INQUIRE, _INQUIRE_NODE_ID = 0x5A, 0x5E
_REFUSALS = {
    (_NODE_ID, 1): "no node id that it can have",
    (_BIT_TIMING, 1): "no bit rate that it can have",
    (_STORE, 1): "it cannot store what LSS gives it",
    (_STORE, 2): "its memory cannot be written",
}
_MAKERS = 255
_NOTHING = -1  # no answer begins with it


@dataclass(frozen=True, slots=True)
class Identity:
    """The four numbers of object 1018h, by which LSS knows a device; no two are to have the same."""

    vendor_id: int
    product_code: int
    revision: int
    serial_number: int

    def __str__(self) -> str:
        return f"0x{self.vendor_id:X}:0x{self.product_code:X}:0x{self.revision:X}:{self.serial_number}"

    @property
    def numbers(self) -> tuple[int, ...]:
        return astuple(self)

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the identity in `VENDOR:PRODUCT:REVISION:SERIAL`, each decimal or 0x….

        Raises `SettingsError`.
        """
        try:
            numbers = [int(word, 0) for word in text.split(":")]
        except ValueError:
            numbers = []
        if len(numbers) != len(PARTS) or not all(0 <= number < 1 << 32 for number in numbers):
            raise SettingsError(
                f"{text!r} is no identity: give VENDOR:PRODUCT:REVISION:SERIAL of 1018h, as in "
                "0x8A:0x21:0x10000:4711"
            )
        return cls(*numbers)


class Bus(Protocol):
    """The part of a `CanBus` that is needed."""

    name: str

    def send(self, can_id: int, data: bytes) -> None: ...

    def subscribe(self, can_id: int, handler: FrameHandler) -> None: ...

    def unsubscribe(self, can_id: int, handler: FrameHandler) -> None: ...


class LssMaster:
    """Asks on an open bus, between `__enter__` and `__exit__`; for one thread.

    Each method raises `Unavailable` where the bus is not open, `DeviceTimeout` where nobody answers, and
    `Mismatch` where several do: two devices with the same identity cannot be told apart.
    """

    def __init__(self, bus: Bus, timeout_s: float = TIMEOUT_S, scan_s: float = SCAN_S) -> None:
        self._bus = bus
        self._timeout_s = timeout_s
        self.scan_s = scan_s
        self._heard: Inbox[bytes] = Inbox()

    def __enter__(self) -> Self:
        self._bus.subscribe(ANSWER, self._hear)
        return self

    def __exit__(self, *_: object) -> None:
        self._bus.unsubscribe(ANSWER, self._hear)

    def _hear(self, _stamp_ns: int, data: bytes) -> None:
        if len(data) == 8:
            self._heard.put(data)

    # -- who is meant --------------------------------------------------------------------------------------

    def select_all(self) -> None:
        """Every device on the bus is to be configured: for a bus with a single one. Nobody answers."""
        self._tell(_SWITCH_ALL, b"\x01")

    def select(self, identity: Identity) -> None:
        """Select the device of this identity for configuration."""
        for part, number in enumerate(identity.numbers[:-1]):
            self._tell(_SWITCH_ONE + part, number.to_bytes(4, "little"))
        serial = identity.serial_number.to_bytes(4, "little")
        answers = self._answers(_SWITCH_ONE + len(PARTS) - 1, serial, _SWITCHED, self._timeout_s)
        if not answers:
            raise DeviceTimeout(
                f"{self._bus.name}: no device with identity {identity} answers LSS: is it switched on, are "
                "these the numbers of its 1018h, is it not operational, has it LSS at all (see its manual)?"
            )
        self._single(answers, f"the identity {identity}")

    def release(self) -> None:
        """End the configuration of all; a device without a node id boots, if it was given one."""
        self._tell(_SWITCH_ALL, b"\x00")

    def matches(self, part: int, number: int, bit: int, then: int) -> bool:
        """Fastscan: whether an unconfigured device has these bits of its number `part` from `bit` upwards.

        Those that have turn to number `then`; to a smaller one: the device is to be configured.
        """
        return self._scan(number, bit, part, then, self.scan_s)

    def is_anybody_unconfigured(self) -> bool:
        """Return whether a device without node id answers, also one that knows no fastscan (it is older)."""
        return bool(self._answers(_IDENTIFY_UNCONFIGURED, b"", _UNCONFIGURED, self._timeout_s))

    def begin_scan(self) -> bool:
        """Fastscan begins anew, at the vendor: whether there is any unconfigured device."""
        return self._scan(0, 128, 0, 0, self._timeout_s)

    # -- what the selected one says ------------------------------------------------------------------------

    def identity(self) -> Identity:
        """Return the identity of the selected device."""
        numbers = []
        for part, name in enumerate(PARTS):
            answer = self._ask(_INQUIRE + part, b"", f"the {name}")
            numbers.append(int.from_bytes(answer[1:5], "little"))
        return Identity(*numbers)

    def node_id(self) -> int:
        """Return the node id that the selected device has now; 255: none."""
        return self._ask(_INQUIRE_NODE_ID, b"", "the node id")[1]

    # -- what it is to become ------------------------------------------------------------------------------

    def set_node_id(self, node_id: int) -> None:
        """Give the selected device a node id, from its next reset of communication; raises `LssRefusal`."""
        self._configure(_NODE_ID, bytes([node_id]), f"node id {node_id}")

    def set_bitrate(self, bitrate: int) -> None:
        """Give it a bit rate (bit/s), from its next start of communication; raises `LssRefusal`."""
        self._configure(_BIT_TIMING, bytes([0, BITRATES[bitrate]]), f"{bitrate} bit/s")

    def store(self) -> None:
        """Let it keep both without power; raises `LssRefusal`."""
        self._configure(_STORE, b"", "to store")

    def activate(self, delay_ms: int) -> None:
        """Let the bit rate count: after the delay; after another one it may send again. Nobody answers."""
        self._tell(_ACTIVATE, delay_ms.to_bytes(2, "little"))

    def _configure(self, command: int, content: bytes, what: str) -> None:
        answer = self._ask(command, content, what)
        code, specific = answer[1], answer[2]
        if not code:
            return
        words = _REFUSALS.get((command, code)) or (
            f"its maker's reason {specific}" if code == _MAKERS else "a reason that CiA 305 does not know"
        )
        raise LssRefusal(
            f"{self._bus.name}: the device refuses {what}: {words} (error {code})", code, specific
        )

    # -- frames --------------------------------------------------------------------------------------------

    def _ask(self, command: int, content: bytes, what: str) -> bytes:
        answers = self._answers(command, content, command, self._timeout_s)
        if not answers:
            raise DeviceTimeout(
                f"{self._bus.name}: asked for {what} by LSS, the selected device does not answer"
            )
        return self._single(answers, what)

    def _single(self, answers: list[bytes], what: str) -> bytes:
        if len(answers) > 1:
            raise Mismatch(
                f"{self._bus.name}: {len(answers)} devices answer to {what}: switch all but one of them off"
            )
        return answers[0]

    def _scan(self, number: int, bit: int, part: int, then: int, timeout_s: float) -> bool:
        content = number.to_bytes(4, "little") + bytes([bit, part, then])
        return bool(self._answers(_FASTSCAN, content, _IDENTIFIED, timeout_s))

    def _tell(self, command: int, content: bytes) -> None:
        self._answers(command, content, _NOTHING, GAP_S)

    def _answers(self, command: int, content: bytes, wanted: int, timeout_s: float) -> list[bytes]:
        """Return the answers to a request: until it is quiet again after the first one."""
        while not self._heard.empty():
            self._heard.get_nowait()
        self._bus.send(REQUEST, (bytes([command]) + content).ljust(8, b"\0"))
        found: list[bytes] = []
        until = time.monotonic() + timeout_s
        left_s = timeout_s
        while left_s > 0 or not self._heard.empty():  # what has come is heard, however late one looks
            try:
                data = self._heard.get(timeout=max(0.0, left_s))
            except queue.Empty:
                break
            if data[0] == wanted:
                found.append(data)
                until = time.monotonic() + SETTLE_S
            elif left_s <= 0:
                break
            left_s = until - time.monotonic()
        return found
