"""One PDO that a device sends or receives: transmission types and timers (CiA 301 §7.2.2)."""

from collections.abc import Callable

from hil_sim.clock import MILLISECOND_NS, Clock, Event
from hil_sim.node import cob_id
from hil_sim.node.dictionary import Dictionary, Key
from hil_sim.node.pdo_mapping import Mapping

RPDO_COMMUNICATION, RPDO_MAPPING = 0x1400, 0x1600
TPDO_COMMUNICATION, TPDO_MAPPING = 0x1800, 0x1A00

# Sub-indices of the communication parameters.
COB_ID, TRANSMISSION_TYPE, INHIBIT_TIME, EVENT_TIMER, SYNC_START = 1, 2, 3, 5, 6

SYNCHRONOUS = range(241)
EVENT_DRIVEN = (254, 255)
SYNCHRONOUS_REMOTE, REMOTE = 252, 253
_ON_CHANGE = (0, *EVENT_DRIVEN)
_INHIBIT_UNIT_NS = 100_000

TOO_SHORT, TOO_LONG, TIMED_OUT = 0x8210, 0x8220, 0x8250  # error codes (CiA 301 table 26)


class Tpdo:
    """One PDO that the device sends."""

    def __init__(
        self, clock: Clock, dictionary: Dictionary, number: int, send: Callable[[int, bytes], None]
    ) -> None:
        self._clock = clock
        self._send = send
        index = TPDO_COMMUNICATION + number
        identifier = dictionary.number((index, COB_ID), cob_id.INVALID)
        self._mapping = Mapping.current(dictionary, TPDO_MAPPING + number)
        self.keys = self._mapping.keys
        self.cob_id = identifier & cob_id.IDENTIFIER
        self.active = cob_id.is_valid(identifier) and bool(self._mapping.fields)
        self._remote = not identifier & cob_id.NO_REMOTE
        self._type = dictionary.number((index, TRANSMISSION_TYPE), 255)
        self._inhibit_ns = dictionary.number((index, INHIBIT_TIME)) * _INHIBIT_UNIT_NS
        self._event_ns = dictionary.number((index, EVENT_TIMER)) * MILLISECOND_NS
        self._sync_start = dictionary.number((index, SYNC_START))
        self._syncs = 0
        self._sent = b""  # what the others know
        self._sampled: bytes | None = None
        self._changed = False
        self._timer: Event | None = None
        self._inhibited: Event | None = None

    @property
    def on_change(self) -> bool:
        """Whether a change of its objects is an event."""
        return self.active and self._type in _ON_CHANGE

    def start(self) -> None:
        """Begin in operational, or when the PDO becomes valid: an event-driven one is sent once."""
        self._syncs = 0
        if self.active and self._type in EVENT_DRIVEN:
            self._transmit()
        else:
            self.resume()

    def resume(self) -> None:
        """Go on with other parameters."""
        if self.active:
            self._sent = self._mapping.pack()
            self._arm()

    def stop(self) -> None:
        for event in (self._timer, self._inhibited):
            if event is not None:
                event.cancel()
        self._timer = self._inhibited = None

    def synchronise(self, counter: int | None) -> None:
        """Take a SYNC, with its `counter`, if any."""
        if not self.active:
            return
        if self._type == SYNCHRONOUS_REMOTE:
            self._sampled = self._mapping.pack()
        elif self._type == 0:
            self.check()
            if self._changed:
                self._transmit()
        elif self._type in SYNCHRONOUS:
            self._count(counter)

    def _count(self, counter: int | None) -> None:
        if counter is not None and self._sync_start:
            if counter != self._sync_start:
                return
            self._sync_start, self._syncs = 0, self._type - 1
        self._syncs += 1
        if self._syncs >= self._type:
            self._syncs = 0
            self._transmit()

    def check(self) -> None:
        """Look whether the objects have other values than were sent."""
        if self.on_change and self._mapping.pack() != self._sent:
            self._event()

    def changed(self, key: Key) -> None:
        """Take a change reported by the application."""
        if self.on_change and key in self.keys:
            self._event()

    def requested(self) -> None:
        """Answer a remote frame."""
        if not (self.active and self._remote):
            return
        if self._type != SYNCHRONOUS_REMOTE:
            self._transmit()
        elif self._sampled is not None:
            self._send(self.cob_id, self._sampled)

    def _event(self) -> None:
        self._changed = True
        if self._type in EVENT_DRIVEN and self._inhibited is None:
            self._transmit()

    def _transmit(self) -> None:
        self._changed = False
        self._sent = self._mapping.pack()
        self._send(self.cob_id, self._sent)
        if self._type in EVENT_DRIVEN:
            self.stop()
            self._arm()
            if self._inhibit_ns:
                self._inhibited = self._clock.after(self._inhibit_ns, self._inhibit_over)

    def _arm(self) -> None:
        if self._event_ns and self._type in EVENT_DRIVEN:
            self._timer = self._clock.after(self._event_ns, self._event)

    def _inhibit_over(self) -> None:
        self._inhibited = None
        if self._changed:
            self._transmit()


class Rpdo:
    """One PDO that the device receives; a synchronous one takes effect with the next SYNC.

    `report` is told an error code and whether that error is there.
    """

    def __init__(
        self, clock: Clock, dictionary: Dictionary, number: int, report: Callable[[int, bool], None]
    ) -> None:
        self._clock = clock
        self._report = report
        index = RPDO_COMMUNICATION + number
        identifier = dictionary.number((index, COB_ID), cob_id.INVALID)
        self._mapping = Mapping.current(dictionary, RPDO_MAPPING + number)
        self.cob_id = identifier & cob_id.IDENTIFIER
        self.active = cob_id.is_valid(identifier) and bool(self._mapping.fields)
        self._type = dictionary.number((index, TRANSMISSION_TYPE), 255)
        self._deadline_ns = dictionary.number((index, EVENT_TIMER)) * MILLISECOND_NS
        self._deadline: Event | None = None
        self._waiting: bytes | None = None
        self.wrong: set[int] = set()  # the errors that were reported and are not over

    @property
    def synchronous(self) -> bool:
        return self._type in SYNCHRONOUS

    def stop(self) -> None:
        self._waiting = None
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def receive(self, data: bytes) -> None:
        length = self._mapping.length
        if self.wrong or len(data) != length:
            self._tell(TOO_SHORT, len(data) < length)
            self._tell(TOO_LONG, len(data) > length)
            self._tell(TIMED_OUT, False)
        if self._deadline_ns:
            self._watch()
        if len(data) < length:
            return
        if self.synchronous:
            self._waiting = data
        else:
            self._mapping.unpack(data)

    def synchronise(self) -> None:
        if self._waiting is not None:
            data, self._waiting = self._waiting, None
            self._mapping.unpack(data)

    def _watch(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
        self._deadline = self._clock.after(self._deadline_ns, lambda: self._tell(TIMED_OUT, True))

    def _tell(self, code: int, present: bool) -> None:
        """Report an error that is there, or one that was."""
        if present or code in self.wrong:
            self._report(code, present)
        (self.wrong.add if present else self.wrong.discard)(code)
