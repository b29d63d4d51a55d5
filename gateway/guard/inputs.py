"""Inputs of rules: a channel, a component's signs of life, its emergency messages, or none."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from drivers.bus.emcy import Emcy
from gateway.config.guard_rules import EmcyRule, GuardRule
from gateway.guard.thresholds import Joined, Judging
from gateway.guard.watcher import GRACE_NS, RuleState, RuleTransition, Watcher

Changed = Callable[[Watcher, RuleTransition], None]
AGAIN_NS = 100_000_000  # how soon to look again for something that is not there


@dataclass(frozen=True, slots=True)
class Pulse:
    """A component's signs of life: when the last one came, and how long it may be silent."""

    last_ns: Callable[[], int | None]
    timeout_s: Callable[[], float]


class LevelWatcher(Watcher):
    """One channel; `judging` says what is made of its value, and where that may lie."""

    def __init__(
        self,
        rule: GuardRule,
        component: str,
        what: str,
        now_ns: int,
        changed: Changed,
        *,
        judging: Judging,
        stale_ns: int,
        coming_ns: int = 0,
    ) -> None:
        """Allow the first number `coming_ns` more than devices take to come up."""
        super().__init__(rule, component, what, now_ns, changed)
        self._says = judging.says
        self._band = judging.band
        self._measure = judging.measure
        self._for_ns = round(judging.for_s * 1e9)
        self._stale_ns = stale_ns
        self._seen_ns: int | None = None
        self._first_ns = now_ns + GRACE_NS + coming_ns

    def see(self, stamp_ns: int, value: float | None) -> None:
        """Take the channel's value; ignore anything but a number."""
        if value is not None and math.isfinite(value):
            self.weigh(stamp_ns, self._measure(stamp_ns, value))

    def weigh(self, stamp_ns: int, number: float) -> None:
        """Take a derived value; infinite is beyond every limit."""
        self._seen_ns = stamp_ns
        over = self._band.left(number, tripped=self.state is RuleState.TRIPPED)
        if not over and (self.is_settled or self._is_late(stamp_ns)):
            return  # nothing changes; what is not live ends nothing
        self.judge(stamp_ns, over, lambda: self._says(number), self._for_ns)

    def _is_late(self, stamp_ns: int) -> bool:
        return time.monotonic_ns() - stamp_ns > self._stale_ns

    def look(self, now_ns: int) -> int:
        seen_ns = self._seen_ns
        due_ns = self._first_ns if seen_ns is None else seen_ns + self._stale_ns
        if now_ns <= due_ns:
            return due_ns + 1
        self.unseen(now_ns, lambda: _no_value(seen_ns, now_ns))
        return now_ns + AGAIN_NS


class Joining:
    """Several channels make the one number of a watcher, which is as old as the oldest of them."""

    def __init__(self, watcher: LevelWatcher, joined: Joined, parts: int, stale_ns: int) -> None:
        self._watcher = watcher
        self._joined = joined
        self._stamps: list[int | None] = [None] * parts
        self._stale_ns = stale_ns
        self._lock = threading.Lock()  # parts may come in several threads

    def see(self, part: int, stamp_ns: int, value: float | None) -> None:
        """Take the value of one of them; ignore anything but a number."""
        if value is None or not math.isfinite(value):
            return
        with self._lock:
            self._stamps[part] = stamp_ns
            number = self._joined(part, stamp_ns, value)
            known = [one for one in self._stamps if one is not None]
        if number is not None and stamp_ns - min(known) <= self._stale_ns:
            self._watcher.weigh(min(known), number)


class SilenceWatcher(Watcher):
    """A component that must be heard. One that was never heard is not lost: it cannot be seen."""

    def __init__(self, rule: GuardRule, component: str, now_ns: int, changed: Changed, pulse: Pulse) -> None:
        super().__init__(rule, component, component, now_ns, changed)
        self._pulse = pulse
        self._heard_ns: int | None = None
        self._began_ns = now_ns

    def look(self, now_ns: int) -> int:
        self._heard_ns = self._pulse.last_ns() or self._heard_ns
        if self._heard_ns is None:
            if now_ns - self._began_ns > GRACE_NS:
                self.unseen(now_ns, lambda: "has not been heard yet")
            return now_ns + AGAIN_NS
        silent_s, timeout_s = (now_ns - self._heard_ns) / 1e9, self._pulse.timeout_s()
        over = silent_s > timeout_s
        self.judge(now_ns, over, lambda: f"silent for {silent_s:.2f} s")
        well = self.state in (RuleState.WATCHING, RuleState.CLEARED)
        return self._heard_ns + round(timeout_s * 1e9) + 1 if well else now_ns + AGAIN_NS

    def on_emcy(self, _emcy: Emcy) -> None:
        """Note that it sends, which its pulse shows too."""

    def on_boot_up(self, stamp_ns: int) -> None:
        """One that was heard before has lost all that it was doing."""
        if self._heard_ns is not None:
            self.judge(stamp_ns, True, lambda: "has booted anew")


class EmcyWatcher(Watcher):
    """A node's emergency messages; of a node that is silent nobody knows."""

    def __init__(
        self, rule: EmcyRule, component: str, now_ns: int, changed: Changed, pulse: Pulse, vendor: int | None
    ) -> None:
        super().__init__(rule, component, component, now_ns, changed)
        self._codes = tuple(code.lower() for code in rule.codes or ("0x",))
        self._pulse = pulse
        self._vendor = vendor
        self._active: Emcy | None = None
        self._began_ns = now_ns

    def on_emcy(self, emcy: Emcy) -> None:
        if emcy.resets:
            self._active = None
        elif f"0x{emcy.code:04x}".startswith(self._codes):
            self._active = emcy
            self.judge(emcy.stamp_ns, True, lambda: emcy.text(self._vendor))

    def on_boot_up(self, _stamp_ns: int) -> None:
        self._active = None

    def look(self, now_ns: int) -> int:
        heard_ns = self._pulse.last_ns()
        if heard_ns is not None and (now_ns - heard_ns) / 1e9 <= self._pulse.timeout_s():
            if self._active is None:
                self.judge(now_ns, False, lambda: "")
        elif now_ns - self._began_ns > GRACE_NS:
            self.unseen(now_ns, lambda: "is silent, so nobody knows whether it has an emergency")
        return now_ns + AGAIN_NS


class UnseenWatcher(Watcher):
    """Something that cannot be watched on this robot, and why."""

    def __init__(self, rule: GuardRule, component: str, now_ns: int, changed: Changed, why: str) -> None:
        super().__init__(rule, component, component, now_ns, changed)
        self.why = why

    def look(self, now_ns: int) -> int:
        self.unseen(now_ns, lambda: self.why)
        return now_ns + GRACE_NS


def _no_value(seen_ns: int | None, now_ns: int) -> str:
    return "has had no value yet" if seen_ns is None else f"no value for {(now_ns - seen_ns) / 1e9:.2f} s"
