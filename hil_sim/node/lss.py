"""Layer setting services of a device: node id and bit rate given over the bus (CiA 305, the slave's side).

An unconfigured device (node id 255) says nothing, not even a boot-up, and knows no service but these.
"""

from enum import Enum, auto
from typing import Final, Protocol

from hil_sim.clock import MILLISECOND_NS, Clock, Event
from hil_sim.node.dictionary import IDENTITY, Dictionary

REQUEST, ANSWER = 0x7E5, 0x7E4
UNCONFIGURED = 255
BITRATES = (1_000_000, 800_000, 500_000, 250_000, 125_000, None, 50_000, 20_000, 10_000)  # table 0; 5 is free

NODE_IDS: Final = (*range(1, 128), UNCONFIGURED)
_DONE, _REFUSED, _NO_ACCESS = 0, 1, 2

_SWITCH_ALL, _NODE_ID, _BIT_TIMING, _ACTIVATE, _STORE = 0x04, 0x11, 0x13, 0x15, 0x17
_SWITCH_ONE, _SWITCHED = range(0x40, 0x44), 0x44
_IDENTIFY, _IDENTIFY_UNCONFIGURED, _FASTSCAN = range(0x46, 0x4C), 0x4C, 0x51
_IDENTIFIED, _UNCONFIGURED_IDENTIFIED = 0x4F, 0x50
_INQUIRE, _INQUIRE_NODE_ID = range(0x5A, 0x5E), 0x5E
_CONFIGURING = 1  # of the global switch
_SCAN_BEGINS = 128  # of fastscan's bit check
# Of the six numbers that identify: vendor, product, then the range of revisions and that of serial numbers.
_RANGE_OF = (0, 1, 2, 2, 3, 3)
_AT_LEAST = frozenset({2, 4})
_AT_MOST = frozenset({3, 5})


class LssState(Enum):
    """State of the slave's state machine."""

    WAITING = auto()
    CONFIGURATION = auto()


class Owner(Protocol):
    """The services' interface to their device."""

    def tell(self, data: bytes, /) -> None:
        """Send an answer."""

    def keep(self, node_id: int, bitrate: int, /) -> None:
        """Keep both without power; raises `OSError` where it cannot."""

    def node_id_given(self) -> None:
        """Begin to communicate: an unconfigured device has a node id now."""

    def bitrate_changed(self) -> None:
        """Use the pending bit rate from now on."""


class Lss:
    """The state machine. `pending` is what becomes active at the next reset of communication.

    Without `stores` the device refuses to store, as some do; without `scans` it knows no fastscan, as some
    older ones; it offers `bitrates` alone.
    """

    def __init__(
        self, clock: Clock, dictionary: Dictionary, owner: Owner, node_id: int, bitrate: int
    ) -> None:
        self._clock = clock
        self._dictionary = dictionary
        self._owner = owner
        self.state = LssState.WAITING
        self.node_id = self.pending_node_id = node_id
        self.bitrate = self.pending_bitrate = bitrate
        self.stores = self.scans = True
        self.bitrates = frozenset(rate for rate in BITRATES if rate is not None)
        self._selected = 0  # how many numbers of a selective switch were ours
        self._in_range = 0  # likewise, of an identification
        self._scan_at = 0
        self._activating: Event | None = None

    @property
    def configured(self) -> bool:
        return self.node_id != UNCONFIGURED

    def begin(self, node_id: int, bitrate: int) -> None:
        """Restore the stored values at power-on or reset."""
        self.pending_node_id, self.pending_bitrate = node_id, bitrate
        self.adopt()

    def adopt(self) -> None:
        """Communication is reset: what was pending becomes active."""
        self.state = LssState.WAITING
        self._selected = self._in_range = self._scan_at = 0
        if self._activating is not None:
            self._activating.cancel()
            self._activating = None
        self.node_id, self.bitrate = self.pending_node_id, self.pending_bitrate

    def received(self, data: bytes) -> None:
        """Take a request of the master; ignore anything else."""
        if len(data) != 8:
            return
        command, number = data[0], int.from_bytes(data[1:5], "little")
        if command == _SWITCH_ALL:
            self._switch_all(data[1])
        elif command in _SWITCH_ONE:
            self._switch_one(command - _SWITCH_ONE[0], number)
        elif command in _IDENTIFY:
            self._identify(command - _IDENTIFY[0], number)
        elif command == _IDENTIFY_UNCONFIGURED:
            if self.pending_node_id == UNCONFIGURED:
                self._answer(_UNCONFIGURED_IDENTIFIED)
        elif command == _FASTSCAN:
            self._fastscan(number, data[5], data[6], data[7])
        elif self.state is LssState.CONFIGURATION:
            self._configure(command, data)

    def _answer(self, command: int, content: bytes = b"") -> None:
        self._owner.tell((bytes([command]) + content).ljust(8, b"\0"))

    def _own(self, part: int) -> int:
        """Vendor, product, revision or serial number."""
        return self._dictionary.number((IDENTITY, part + 1))

    # -- who is meant --------------------------------------------------------------------------------------

    def _switch_all(self, mode: int) -> None:
        if mode == _CONFIGURING:
            self.state = LssState.CONFIGURATION
        elif mode == 0:
            left = self.state is LssState.CONFIGURATION
            self.state = LssState.WAITING
            if left and not self.configured and self.pending_node_id != UNCONFIGURED:
                self._owner.node_id_given()

    def _switch_one(self, part: int, number: int) -> None:
        self._selected = self._step(self._selected, part, number == self._own(part))
        if self._selected == len(_SWITCH_ONE) and self.state is LssState.WAITING:
            self.state = LssState.CONFIGURATION
            self._answer(_SWITCHED)

    def _identify(self, place: int, number: int) -> None:
        own = self._own(_RANGE_OF[place])
        fits = own >= number if place in _AT_LEAST else own <= number if place in _AT_MOST else own == number
        self._in_range = self._step(self._in_range, place, fits)
        if self._in_range == len(_IDENTIFY):
            self._answer(_IDENTIFIED)

    @staticmethod
    def _step(so_far: int, place: int, fits: bool) -> int:
        """Numbers come in their order, the first begins anew; returns how many were ours in a row."""
        if not fits or place not in (0, so_far):
            return 0
        return place + 1

    def _fastscan(self, number: int, bit: int, part: int, then: int) -> None:
        if self.pending_node_id != UNCONFIGURED or self.configured or self.state is not LssState.WAITING:
            return
        if not self.scans:
            return
        if bit == _SCAN_BEGINS:
            self._scan_at = 0
            self._answer(_IDENTIFIED)
            return
        if (
            part != self._scan_at
            or max(part, then) > 3
            or bit > 31
            or self._own(part) >> bit != number >> bit
        ):
            return
        self._scan_at = then
        self._answer(_IDENTIFIED)
        if bit == 0 and then < part:
            self.state = LssState.CONFIGURATION

    # -- what it is to become ------------------------------------------------------------------------------

    def _configure(self, command: int, data: bytes) -> None:
        if command in _INQUIRE:
            self._answer(command, self._own(command - _INQUIRE[0]).to_bytes(4, "little"))
        elif command == _INQUIRE_NODE_ID:
            self._answer(command, bytes([self.node_id]))
        elif command == _NODE_ID:
            self._answer(command, bytes([self._take_node_id(data[1])]))
        elif command == _BIT_TIMING:
            self._answer(command, bytes([self._take_bitrate(data[1], data[2])]))
        elif command == _STORE:
            self._answer(command, bytes([self._keep()]))
        elif command == _ACTIVATE:
            self._activate(int.from_bytes(data[1:3], "little"))

    def _take_node_id(self, node_id: int) -> int:
        if node_id not in NODE_IDS:
            return _REFUSED
        self.pending_node_id = node_id
        return _DONE

    def _take_bitrate(self, table: int, number: int) -> int:
        rate = BITRATES[number] if table == 0 and number < len(BITRATES) else None
        if rate is None or rate not in self.bitrates:
            return _REFUSED
        self.pending_bitrate = rate
        return _DONE

    def _keep(self) -> int:
        if not self.stores:
            return _REFUSED
        try:
            self._owner.keep(self.pending_node_id, self.pending_bitrate)
        except OSError:
            return _NO_ACCESS
        return _DONE

    def _activate(self, delay_ms: int) -> None:
        """Use the other rate after the delay; the second one, of silence, is the master's to keep."""

        def change() -> None:
            self._activating = None
            self.bitrate = self.pending_bitrate
            self._owner.bitrate_changed()

        if self._activating is not None:
            self._activating.cancel()
        self._activating = self._clock.after(delay_ms * MILLISECOND_NS, change)
