"""TIME: the time of day, taken or made by the device, at the COB-ID of 1012h (CiA 301 §7.2.6, §7.5.2.15)."""

import struct
from collections.abc import Callable, Iterator

from hil_sim.bus.can_bus import Frame
from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock, Repeating
from hil_sim.node import cob_id
from hil_sim.node.dictionary import Dictionary

COB_ID = (0x1012, 0)
PERIOD_NS = SECOND_NS  # how often is the maker's choice

_CONSUMES, _PRODUCES = 1 << 31, 1 << 30
_LENGTH = 6
_DAY_MS = 86_400_000


class TimeStamp:
    """`taken` is the last time of day that came: milliseconds after midnight, days since 1984-01-01."""

    def __init__(
        self,
        clock: Clock,
        dictionary: Dictionary,
        send: Callable[[int, bytes], None],
        moved: Callable[[], None],
    ) -> None:
        self._clock = clock
        self._dictionary = dictionary
        self._send = send
        self._moved = moved
        self._timer: Repeating | None = None
        self.taken: tuple[int, int] | None = None
        if (entry := dictionary.get(COB_ID)) is not None:
            entry.on_write = cob_id.guard(entry, exists=lambda _: True, frozen=_is_used)
            entry.on_written = self._written

    def handlers(self) -> Iterator[tuple[int, Callable[[Frame], None]]]:
        """Yield the identifier to listen to, where the device takes the time."""
        value = self._dictionary.number(COB_ID)
        if value & _CONSUMES:
            yield value & cob_id.IDENTIFIER, self._received

    def start(self) -> None:
        """Produce it from now on, if this device does."""
        self.stop()
        if self._dictionary.number(COB_ID) & _PRODUCES:
            self._timer = self._clock.every(PERIOD_NS, self._produce)

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _written(self) -> None:
        self.start()
        self._moved()

    def _received(self, frame: Frame) -> None:
        if self._timer is None and not frame.remote and len(frame.data) == _LENGTH:
            milliseconds, days = struct.unpack("<IH", frame.data)
            self.taken = milliseconds & 0x0FFF_FFFF, days

    def _produce(self) -> None:
        now_ms = self._clock.now_ns // MILLISECOND_NS
        identifier = self._dictionary.number(COB_ID) & cob_id.IDENTIFIER
        self._send(identifier, struct.pack("<IH", now_ms % _DAY_MS, now_ms // _DAY_MS))


def _is_used(value: int) -> bool:
    """Then the identifier stays what it is."""
    return bool(value & (_CONSUMES | _PRODUCES))
