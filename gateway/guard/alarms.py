"""Alarms of the guard: in the journal, without floods, and as channels of its own."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from drivers.latest import Latest, Listener
from drivers.samples import Channel
from gateway.config.guard import ALARMS
from gateway.guard.watcher import RuleState
from gateway.process.loop import Loop

log = logging.getLogger(__name__)

WHO, ALARM = "guard", "alarm"
SAY_AGAIN_S = 5.0  # how often one rule is written down; what comes between is counted, the newest is told
STALE_S = 2.0  # a guard that says nothing for so long is not there
STATE_WORDS = {int(state): state.words for state in RuleState}


class Append(Protocol):
    """Function that appends an entry to the journal."""

    def __call__(self, who: str, what: str, /, **details: Any) -> object: ...


class Alarms:
    """Entries about one thing after another. It belongs to the loop's thread."""

    def __init__(self, loop: Loop, append: Append) -> None:
        self._loop = loop
        self._append = append
        self._silent_until: dict[str, float] = {}
        self._held_back: dict[str, tuple[str, str, int]] = {}

    def tell(self, about: str, what: str, reason: str) -> None:
        """Write it down now, or with the next entry about the same."""
        left_s = self._silent_until.get(about, 0.0) - time.monotonic()
        if left_s <= 0:
            self._write(about, what, reason, 0)
            return
        if about not in self._held_back:
            self._loop.call_later(left_s, lambda: self._release(about))
        more = self._held_back.get(about, ("", "", 0))[2]
        self._held_back[about] = (what, reason, more + 1)

    def _release(self, about: str) -> None:
        what, reason, count = self._held_back.pop(about)
        self._write(about, what, reason, count - 1)

    def _write(self, about: str, what: str, reason: str, left_out: int) -> None:
        self._silent_until[about] = time.monotonic() + SAY_AGAIN_S
        more = {"left_out": left_out} if left_out else {}
        level = logging.WARNING if what == ALARM else logging.INFO
        log.log(level, "%s %s: %s%s", what, about, reason, f" ({left_out} more before)" if left_out else "")
        self._append(WHO, what, about=about, reason=reason, **more)


class GuardSource:
    """The state of every rule, and how many alarms there were, as a component that streams can carry."""

    name = WHO

    def __init__(self, rules: Sequence[str]) -> None:
        states = (Channel(f"{WHO}.{rule}", WHO, rule, "", STATE_WORDS) for rule in rules)
        self.channels: tuple[Channel, ...] = (Channel(f"{WHO}.{ALARMS}", WHO, ALARMS, ""), *states)
        self.latest = Latest(WHO, self.channels, STALE_S)
        self._indices = tuple(range(len(self.channels)))

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        return self.latest.subscribe(listener)

    def publish(self, now_ns: int, alarms: int, states: Mapping[str, RuleState]) -> None:
        self.latest.update(now_ns, self._indices, (alarms, *states.values()))
