"""Heartbeat: the producer (1017h) and the consumer that misses one (1016h) of a device (CiA 301 §7.2.8.3)."""

from collections.abc import Callable

from hil_sim.clock import MILLISECOND_NS, Clock, Event, Repeating
from hil_sim.node.dictionary import Dictionary, Value

PRODUCER = (0x1017, 0)
CONSUMER = 0x1016


class HeartbeatProducer:
    """Calls `send` each 1017h milliseconds; 0 keeps silent."""

    def __init__(self, clock: Clock, dictionary: Dictionary, send: Callable[[], None]) -> None:
        self._clock = clock
        self._send = send
        self._entry = dictionary[PRODUCER]
        self._entry.on_write = self._start
        self._timer: Repeating | None = None

    def start(self) -> None:
        self._start(self._entry.number())

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _start(self, period_ms: Value) -> None:
        self.stop()
        if isinstance(period_ms, int) and period_ms > 0:
            self._timer = self._clock.every(period_ms * MILLISECOND_NS, self._send)


class HeartbeatConsumer:
    """Calls `lost` with the node whose heartbeat stayed away longer than 1016h allows.

    Watching begins with the first heartbeat that is received.
    """

    def __init__(self, clock: Clock, dictionary: Dictionary, lost: Callable[[int], None]) -> None:
        self._clock = clock
        self._lost = lost
        self._entries = dictionary.members(CONSUMER)[1:]
        self._timers: dict[int, Event] = {}

    def times_ns(self) -> dict[int, int]:
        """The nodes that are watched, each with its consumer time."""
        values = [entry.number() for entry in self._entries]
        times = {value >> 16 & 0x7F: (value & 0xFFFF) * MILLISECOND_NS for value in values}
        return {node: time for node, time in times.items() if node and time}

    def stop(self) -> None:
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()

    def received(self, node_id: int) -> None:
        timer = self._timers.pop(node_id, None)
        if timer is not None:
            timer.cancel()
        time_ns = self.times_ns().get(node_id)
        if time_ns is not None:
            self._timers[node_id] = self._clock.after(time_ns, lambda: self._expire(node_id))

    def _expire(self, node_id: int) -> None:
        del self._timers[node_id]
        if node_id in self.times_ns():
            self._lost(node_id)
