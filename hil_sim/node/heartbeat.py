"""Heartbeat: the producer (1017h) and the consumer that misses one (1016h) of a device (CiA 301 §7.2.8.3)."""

from collections.abc import Callable

from hil_sim.clock import MILLISECOND_NS, Clock, Event, Repeating
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Dictionary, Entry, Value

PRODUCER = (0x1017, 0)
CONSUMER = 0x1016

_NODES = range(1, 128)


class HeartbeatProducer:
    """Calls `send` each 1017h milliseconds; 0 keeps silent."""

    def __init__(self, clock: Clock, dictionary: Dictionary, send: Callable[[], None]) -> None:
        self._clock = clock
        self._dictionary = dictionary
        self._send = send
        self._timer: Repeating | None = None
        if PRODUCER in dictionary:
            dictionary[PRODUCER].on_written = self._written

    @property
    def running(self) -> bool:
        return self._timer is not None

    def start(self) -> None:
        """Begin after the boot-up message, which was the first heartbeat."""
        self.stop()
        period_ms = self._dictionary.number(PRODUCER)
        if period_ms:
            self._timer = self._clock.every(period_ms * MILLISECOND_NS, self._send)

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _written(self) -> None:
        """Take a write of the period: a new one begins with a heartbeat."""
        self.start()
        if self.running:
            self._send()


class HeartbeatConsumer:
    """Calls `lost` with a node whose heartbeat stayed away longer than 1016h allows, `back` when it returns.

    Watching begins with the first heartbeat that is received.
    """

    def __init__(
        self, clock: Clock, dictionary: Dictionary, lost: Callable[[int], None], back: Callable[[int], None]
    ) -> None:
        self._clock = clock
        self._on_lost = lost
        self._on_back = back
        self._entries = dictionary.members(CONSUMER)[1:]
        self._timers: dict[int, Event] = {}
        self._lost: set[int] = set()
        for entry in self._entries:
            entry.on_write = self._check(entry)

    def times_ns(self) -> dict[int, int]:
        """Return the nodes that are watched, each with its consumer time."""
        watched = [_watched(entry.number()) for entry in self._entries]
        return {node: time_ms * MILLISECOND_NS for node, time_ms in watched if node in _NODES and time_ms}

    def stop(self) -> None:
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        self._lost.clear()

    def received(self, node_id: int) -> None:
        self._forget(node_id)
        time_ns = self.times_ns().get(node_id)
        if time_ns is not None:
            self._timers[node_id] = self._clock.after(time_ns, lambda: self._expire(node_id))

    def _expire(self, node_id: int) -> None:
        del self._timers[node_id]
        self._lost.add(node_id)
        self._on_lost(node_id)

    def _check(self, entry: Entry) -> Callable[[Value], None]:
        def check(value: Value) -> None:
            node, time_ms = _watched(int(value))
            others = [_watched(other.number()) for other in self._entries if other is not entry]
            if time_ms and any(node == other and other_ms for other, other_ms in others):
                raise SdoAbort(AbortCode.INCOMPATIBLE)
            self._forget(_watched(entry.number())[0])

        return check

    def _forget(self, node_id: int) -> None:
        """Watch a node no more, until its next heartbeat; it is missed no more either."""
        timer = self._timers.pop(node_id, None)
        if timer is not None:
            timer.cancel()
        if node_id in self._lost:
            self._lost.discard(node_id)
            self._on_back(node_id)


def _watched(value: int) -> tuple[int, int]:
    """Node id and consumer time (ms) of an entry of 1016h."""
    return value >> 16 & 0xFF, value & 0xFFFF
