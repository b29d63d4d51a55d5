"""Signs of life of a node: boot-up, heartbeat (or answers to node guarding), EMCY."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

from drivers.bus.emcy import Emcy, parse_emcy
from drivers.bus.nmt import NmtState, parse_heartbeat
from drivers.reader_stalls import ReaderStalls

EMCY_HISTORY = 64
HEARTBEATS_MISSED = 2.5  # periods without a heartbeat, where no time is configured
BEATS = 4  # intervals that a period is learned from
OTHER_PERIOD = 0.25  # of the announced one: a master has given the device another since
SHORTEST_S = 0.02  # that is learned


class LifeListener(Protocol):
    """Listener to a node's messages; in the bus's thread: returns at once, never raises."""

    def on_emcy(self, emcy: Emcy) -> None: ...

    def on_boot_up(self, stamp_ns: int) -> None: ...


class NodeLife:
    """Fed by the bus's thread, read by any. Stamps are ns of the monotonic clock."""

    def __init__(self, configured_timeout_s: float | None, standstill: ReaderStalls | None = None) -> None:
        """`standstill` is that of the bus on which it is heard."""
        self.emcy_history: deque[Emcy] = deque(maxlen=EMCY_HISTORY)
        self.boots = 0
        self.emcys = 0
        self.heartbeats = 0
        self.nmt_state: NmtState | None = None
        self.active_emcy: Emcy | None = None  # the last one that was not taken back
        self.heard_ns: int | None = None  # anything that the node itself sent, PDOs excepted
        self.heartbeat_ns: int | None = None
        self.timeout_s = configured_timeout_s
        self._configured_timeout_s = configured_timeout_s
        self._period_s: float | None = None
        self._standstill = standstill or ReaderStalls()
        self._beats: deque[float] = deque(maxlen=BEATS)
        self._listeners: tuple[LifeListener, ...] = ()

    def subscribe(self, listener: LifeListener) -> Callable[[], None]:
        """Tell `listener` of each EMCY and boot-up; returns how to end it."""
        self._listeners = (*self._listeners, listener)

        def unsubscribe() -> None:
            self._listeners = tuple(known for known in self._listeners if known is not listener)

        return unsubscribe

    def reset(self) -> None:
        """Forget what is no longer true; what is counted stays."""
        self.nmt_state = self.active_emcy = self.heard_ns = self.heartbeat_ns = None
        self.timeout_s = self._configured_timeout_s
        self._period_s = None
        self._beats.clear()

    def expect_every(self, period_s: float | None) -> None:
        """Take the device's own heartbeat period if no time is configured; `None`: no heartbeat."""
        if self._configured_timeout_s is None:
            self._period_s = period_s
            self.timeout_s = period_s * HEARTBEATS_MISSED if period_s else None

    def _learn(self, interval_s: float) -> None:
        """Take the actual period of a device: another master may set its 1017h later.

        The second shortest of the last intervals, so that neither a lost nor a doubled frame counts.
        """
        self._beats.append(interval_s)
        if self._configured_timeout_s is not None or len(self._beats) < BEATS:
            return
        found_s = max(sorted(self._beats)[1], SHORTEST_S)
        if self._period_s is None or abs(found_s - self._period_s) > OTHER_PERIOD * self._period_s:
            self.expect_every(found_s)

    def on_heartbeat(self, stamp_ns: int, data: bytes) -> NmtState | None:
        """Take a frame of 700h + node id; `None` where it is none."""
        state = parse_heartbeat(data)
        if state is None:
            return None
        if state is NmtState.BOOT_UP:
            self.boots += 1
            self.reset()
            for listener in self._listeners:
                listener.on_boot_up(stamp_ns)
        else:
            self.heartbeats += 1
            # What waited comes in a burst: its intervals are not the device's.
            if self.heartbeat_ns is not None and self._standstill.is_settled(stamp_ns):
                self._learn((stamp_ns - self.heartbeat_ns) / 1e9)
        self.heard_ns = self.heartbeat_ns = stamp_ns
        self.nmt_state = state
        return state

    def on_emcy(self, stamp_ns: int, data: bytes) -> None:
        """Take an EMCY frame."""
        emcy = parse_emcy(stamp_ns, data)
        if emcy is None:
            return
        self.emcys += 1
        self.heard_ns = stamp_ns
        self.emcy_history.append(emcy)
        self.active_emcy = None if emcy.resets else emcy
        for listener in self._listeners:
            listener.on_emcy(emcy)

    def silent_ms(self, now_ns: int) -> float | None:
        """Since its last heartbeat, or anything else it said itself; `None` before the first."""
        last_ns = self.heard_ns if self.heartbeat_ns is None else self.heartbeat_ns
        return None if last_ns is None else max(0, now_ns - last_ns) / 1e6

    def lost(self, now_ns: int) -> bool:
        """Return whether a heartbeat that came, or is asked for, stays away."""
        if self.timeout_s is None or self.heartbeat_ns is None:
            return False
        return self._standstill.silent_ns(self.heartbeat_ns, now_ns) / 1e9 > self.timeout_s

    def problem(self, now_ns: int) -> str | None:
        """Return the problem of a node that came up, in words."""
        if self.lost(now_ns):
            words = self._standstill.words(now_ns, self.heartbeat_ns, self.timeout_s or 0.0)
            if words is not None:
                return words
            silent_s = (self.silent_ms(now_ns) or 0) / 1000
            return f"its heartbeat has been missing for {silent_s:.1f} s: check the node's power and cable"
        # After a boot-up message alone nobody knows: a node may start itself.
        if self.nmt_state in (NmtState.STOPPED, NmtState.PRE_OPERATIONAL):
            return f"it is {self.nmt_state.words} (NMT) and sends no PDOs until its master starts it"
        return None
