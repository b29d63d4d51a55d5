"""Node guarding: the master asks a node for its state, and the node misses its master (CiA 301 §7.2.8.3)."""

from collections.abc import Callable

from hil_sim.clock import MILLISECOND_NS, Clock, Event
from hil_sim.node.dictionary import Dictionary

GUARD_TIME = (0x100C, 0)
LIFE_TIME_FACTOR = (0x100D, 0)

_TOGGLE = 0x80


class Guarding:
    """Answers guard requests with a toggling state; calls `lost` when they stay away, `back` when they come.

    The node's life time is 100Ch · 100Dh; it is watched from the first request on, and 0 does not watch.
    """

    def __init__(
        self,
        clock: Clock,
        dictionary: Dictionary,
        send: Callable[[bytes], None],
        lost: Callable[[], None],
        back: Callable[[], None],
    ) -> None:
        self._clock = clock
        self._dictionary = dictionary
        self._send = send
        self._on_lost = lost
        self._on_back = back
        self._toggle = 0
        self._timer: Event | None = None
        self._lost = False
        self.supported = GUARD_TIME in dictionary and LIFE_TIME_FACTOR in dictionary
        if self.supported:
            for key in (GUARD_TIME, LIFE_TIME_FACTOR):
                dictionary[key].on_written = self._stop_watching

    def reset(self) -> None:
        """Reset: the next answer has toggle bit 0, and watching waits for the next request."""
        self._toggle = 0
        self._lost = False
        self._stop_watching()

    def requested(self, state: int) -> None:
        """Answer a remote frame for the node's state."""
        self._send(bytes([state | self._toggle]))
        self._toggle ^= _TOGGLE
        self._stop_watching()
        life_time_ms = self._dictionary.number(GUARD_TIME) * self._dictionary.number(LIFE_TIME_FACTOR)
        if life_time_ms:
            self._timer = self._clock.after(life_time_ms * MILLISECOND_NS, self._expire)
        if self._lost:
            self._lost = False
            self._on_back()

    def _stop_watching(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _expire(self) -> None:
        self._timer = None
        self._lost = True
        self._on_lost()
