"""Inputs of rules on a CAN bus: its presence, and the timing of SYNC."""

import time

from drivers.bus.bus import BusUser, CanBus
from drivers.bus.interfaces.controller_state import BusState
from gateway.config.guard_rules import BusRule, SyncRule
from gateway.guard.inputs import AGAIN_NS, Changed, Pulse, SilenceWatcher
from gateway.guard.watcher import GRACE_NS, Watcher

_ENDING = (BusState.PASSIVE, BusState.OFF)  # of our controller: it all but takes part no more


class BusWatcher(Watcher, BusUser):
    """A bus that must be open and heard. One that was never heard is not lost: it cannot be seen."""

    def __init__(self, rule: BusRule, bus: CanBus, now_ns: int, changed: Changed) -> None:
        super().__init__(rule, bus.name, bus.name, now_ns, changed)
        self._bus = bus
        self._silent_s = rule.silent_s
        self._open = False
        self._frames = bus.frames
        self._heard_ns: int | None = None
        self._first_ns = now_ns + GRACE_NS

    def bus_opened(self) -> None:
        self._open = True

    def bus_closed(self) -> None:
        self._open = False
        self.look(time.monotonic_ns())

    def tick(self, now_ns: int) -> None:
        self.look(now_ns)

    def look(self, now_ns: int) -> int:
        frames = self._bus.frames
        if frames != self._frames:
            self._frames, self._heard_ns = frames, now_ns
        wrong = self._wrong(now_ns)
        if wrong is not None:
            self.judge(now_ns, True, lambda: wrong)
        elif self._heard_ns is not None:
            self.judge(now_ns, False, lambda: "")
        elif now_ns > self._first_ns:
            self.unseen(now_ns, lambda: self._bus.problem or "no frame has come yet")
        return now_ns + AGAIN_NS

    def _wrong(self, now_ns: int) -> str | None:
        if self._bus.state in _ENDING:
            return f"our CAN controller is {self._bus.state}"
        if self._heard_ns is None:
            return None
        if not self._open:
            return f"is gone: {self._bus.problem}"
        silent_s = (now_ns - self._heard_ns) / 1e9
        return f"no frame for {silent_s:.2f} s" if silent_s > self._silent_s else None


class SyncWatcher(SilenceWatcher):
    """SYNC must come in time: one that is late is seen as it comes, one that stays away in the loop."""

    def __init__(self, rule: SyncRule, bus: str, now_ns: int, changed: Changed) -> None:
        self._last_ns: int | None = None
        self._longest_ns = round(rule.longest_s * 1e9)
        pulse = Pulse(lambda: self._last_ns, lambda: rule.longest_s)
        super().__init__(rule, bus, now_ns, changed, pulse)

    def on_frame(self, stamp_ns: int, _data: bytes) -> None:
        """Take a SYNC."""
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if last_ns is not None and stamp_ns - last_ns > self._longest_ns:
            self.judge(stamp_ns, True, lambda: f"SYNC came after {(stamp_ns - last_ns) / 1e9:.3f} s")
