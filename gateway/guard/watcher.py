"""One input of one rule, and its state: what is seen is judged in the thread that brings it.

    WATCHING ── is where it must not be, for long enough ──▶ TRIPPED ── well for clear_s ──▶ CLEARED
        └────── nothing to see for too long ──▶ BLIND (or TRIPPED, where the rule says so)

What is unknown never ends a trip, and never counts as well.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from gateway.config.guard_rules import Blind, GuardRule

GRACE_NS = 3_000_000_000  # how long a device that nobody has heard yet may take to come up


class RuleState(IntEnum):
    """State of a rule or of one of its inputs; the worst counts."""

    WATCHING = 0
    CLEARED = 1  # it had tripped, and that is over
    BLIND = 2  # it cannot see what it watches
    TRIPPED = 3

    @property
    def words(self) -> str:
        return self.name.lower()


@dataclass(frozen=True, slots=True)
class RuleTransition:
    """New state of a watcher; `acts` if the rule's actions are due."""

    state: RuleState
    stamp_ns: int
    reason: str

    @property
    def acts(self) -> bool:
        return self.state is RuleState.TRIPPED


class Watcher:
    """One input of one rule. Any thread may bring something; `changed` is called in that thread.

    `component` is whose input it is, `what` is the input in words.
    """

    def __init__(
        self,
        rule: GuardRule,
        component: str,
        what: str,
        now_ns: int,
        changed: "Callable[[Watcher, RuleTransition], None]",
    ) -> None:
        self.rule = rule
        self.component = component
        self.what = what
        self.last = RuleTransition(RuleState.WATCHING, now_ns, "")
        self.trips = 0
        self._changed = changed
        self._clear_ns = round(rule.clear_s * 1e9)
        self._lock = threading.Lock()
        self._over_since_ns: int | None = None
        self._well_since_ns: int | None = None

    @property
    def state(self) -> RuleState:
        return self.last.state

    @property
    def is_settled(self) -> bool:
        """Whether another value that is well changes nothing, as it mostly is."""
        return self._over_since_ns is None and self.last.state in (RuleState.WATCHING, RuleState.CLEARED)

    def look(self, now_ns: int) -> int:
        """See what has not come; returns when to look again at the latest (ns)."""
        raise NotImplementedError

    def judge(self, stamp_ns: int, over: bool, words: Callable[[], str], for_ns: int = 0) -> None:
        """Take whether the value is `over` the limit at `stamp_ns`; over for `for_ns` it trips."""
        with self._lock:
            change = self._on_over(stamp_ns, words, for_ns) if over else self._on_well(stamp_ns)
        self._tell(change)

    def unseen(self, now_ns: int, words: Callable[[], str]) -> None:
        """There is nothing to see, and has not been for too long."""
        with self._lock:
            self._over_since_ns = self._well_since_ns = None
            change = None
            if self.state not in (RuleState.BLIND, RuleState.TRIPPED):
                state = RuleState.TRIPPED if self.rule.blind is Blind.ACT else RuleState.BLIND
                change = self._go(state, now_ns, f"{self.what}: {words()}")
        self._tell(change)

    def _on_over(self, stamp_ns: int, words: Callable[[], str], for_ns: int) -> RuleTransition | None:
        self._well_since_ns = None
        if self._over_since_ns is None:
            self._over_since_ns = stamp_ns
        if self.state is RuleState.TRIPPED or stamp_ns - self._over_since_ns < for_ns:
            return None
        return self._go(RuleState.TRIPPED, stamp_ns, f"{self.what}: {words()}")

    def _on_well(self, stamp_ns: int) -> RuleTransition | None:
        self._over_since_ns = None
        if self.state is RuleState.BLIND:
            return self._go(RuleState.CLEARED if self.trips else RuleState.WATCHING, stamp_ns, "")
        if self.state is not RuleState.TRIPPED:
            return None
        if self._well_since_ns is None:
            self._well_since_ns = stamp_ns
        if stamp_ns - self._well_since_ns < self._clear_ns:
            return None
        return self._go(RuleState.CLEARED, stamp_ns, self.last.reason)

    def _go(self, state: RuleState, stamp_ns: int, reason: str) -> RuleTransition:
        self._over_since_ns = self._well_since_ns = None
        self.trips += state is RuleState.TRIPPED
        self.last = RuleTransition(state, stamp_ns, reason)
        return self.last

    def _tell(self, change: RuleTransition | None) -> None:
        if change is not None:
            self._changed(self, change)
