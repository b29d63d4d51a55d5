"""SYNC: taking it, its window, and making it where the device is its producer (CiA 301 §7.2.5)."""

from collections.abc import Callable

from hil_sim.clock import Clock, Repeating
from hil_sim.node import cob_id
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Dictionary, Value

COB_ID = (0x1005, 0)
CYCLE_PERIOD = (0x1006, 0)
WINDOW = (0x1007, 0)  # µs after a SYNC in which synchronous PDOs count; 0: until the next
COUNTER_OVERFLOW = (0x1019, 0)

_DEFAULT_COB_ID = 0x80
_OVERFLOWS = (0, *range(2, 241))  # 0: SYNC has no counter


class Sync:
    """Calls `arrived` with the counter of each SYNC (`None` where it has none), its own ones too.

    `wrong_length` is called for a SYNC that is none, `moved` when the COB-ID changes.
    """

    def __init__(
        self,
        clock: Clock,
        dictionary: Dictionary,
        send: Callable[[int, bytes], None],
        arrived: Callable[[int | None], None],
        wrong_length: Callable[[], None],
        moved: Callable[[], None],
    ) -> None:
        self._clock = clock
        self._dictionary = dictionary
        self._send = send
        self._arrived = arrived
        self._wrong_length = wrong_length
        self._moved = moved
        self._timer: Repeating | None = None
        self._counter = 0
        self._arrived_ns = clock.now_ns
        self._guard()

    @property
    def cob_id(self) -> int:
        return self._dictionary.number(COB_ID, _DEFAULT_COB_ID) & cob_id.IDENTIFIER

    @property
    def window_over(self) -> bool:
        """Whether it is too late for a synchronous PDO until the next SYNC."""
        window_us = self._dictionary.number(WINDOW)
        return bool(window_us) and self._clock.now_ns - self._arrived_ns > window_us * 1000

    def received(self, data: bytes) -> None:
        if len(data) != bool(self._dictionary.number(COUNTER_OVERFLOW)):
            self._wrong_length()
        else:
            self._arrived_ns = self._clock.now_ns
            self._arrived(data[0] if data else None)

    def start(self) -> None:
        """Produce SYNC from now on, if this device does."""
        self.stop()
        period_us = self._dictionary.number(CYCLE_PERIOD)
        if period_us and _produces(self._dictionary.number(COB_ID)):
            self._counter = 0
            self._timer = self._clock.every(period_us * 1000, self._produce)

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _produce(self) -> None:
        overflow = self._dictionary.number(COUNTER_OVERFLOW)
        counter = self._counter = self._counter % overflow + 1 if overflow else 0
        self._arrived_ns = self._clock.now_ns
        self._send(self.cob_id, bytes([counter]) if overflow else b"")
        self._arrived(counter or None)

    # -- what may be written -----------------------------------------------------------------------------

    def _guard(self) -> None:
        for key, check, written in (
            (COB_ID, self._check_cob_id, self._cob_id_written),
            (CYCLE_PERIOD, None, self.start),
            (COUNTER_OVERFLOW, self._check_overflow, None),
        ):
            entry = self._dictionary.get(key)
            if entry is not None:
                entry.on_write, entry.on_written = check, written

    def _check_cob_id(self, value: Value) -> None:
        if _produces(int(value)) and CYCLE_PERIOD not in self._dictionary:
            raise SdoAbort(AbortCode.INVALID_VALUE)
        cob_id.guard(self._dictionary[COB_ID], exists=lambda _: True, frozen=_produces)(value)

    def _cob_id_written(self) -> None:
        self.start()
        self._moved()

    def _check_overflow(self, value: Value) -> None:
        if value not in _OVERFLOWS:
            raise SdoAbort(AbortCode.INVALID_VALUE)
        if self._dictionary.number(CYCLE_PERIOD):
            raise SdoAbort(AbortCode.WRONG_STATE)


def _produces(value: int) -> bool:
    return bool(value & cob_id.PRODUCES)
