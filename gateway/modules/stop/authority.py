"""The one authority over motion: the stop's state machine behind a lock, for any thread.

A stop takes effect here first: from the instant in which `feed` returns, whatever a permit forbids is refused
at the last moment before it would go out (`SdoChannel.download`), and only then are the drives asked to stop.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from gateway.modules.stop.machine import (
    Event,
    Input,
    ResetFinding,
    StopMachineState,
    Transition,
    step,
    unproved,
)

Address = tuple[str, int, int, int]  # bus, node id, index, sub-index
Act = Callable[[Transition], None]

LOCKED = "it stops a controller, and a stop is held: reset it first"


@dataclass(frozen=True, slots=True)
class Permit:
    """Permission of one write: as of its request, until the next stop."""

    authority: "Authority"
    asked_ns: int  # when it came in

    def objection(self, address: Address) -> str | None:
        """Return why the object must not be written now, in words; `None` if it may. From any thread."""
        if self.authority.state.asked_ns >= self.asked_ns:
            return "the robot was stopped before this was written"
        return self.authority.objection_to(address) or self.authority.frozen()


class Authority:
    """One robot's. `locked` are the objects that stop its controllers."""

    def __init__(self, targets: Iterable[str], locked: Iterable[Address]) -> None:
        self.state = StopMachineState(frozenset(targets))
        self.locked = frozenset(locked)
        self.standing: Callable[[], Mapping[str, str]] = dict  # the guard's: tripped rules that stop, and why
        self.frozen: Callable[[], str | None] = lambda: None  # the guard's: why no parameter may be changed
        self._lock = threading.Lock()

    @property
    def held(self) -> bool:
        """Whether a stop is held."""
        return self.state.held

    def feed(
        self,
        what: Input,
        act: Act,
        *,
        at_ns: int | None = None,
        target: str = "",
        number: int = 0,
        findings: Mapping[str, ResetFinding] = MappingProxyType({}),
    ) -> Transition:
        """Feed an event; `act` receives the transition, in the order of events, and must not block."""
        with self._lock:
            standing = tuple(f"{name} ({why})" for name, why in self.standing().items())
            now_ns = time.monotonic_ns() if at_ns is None else at_ns
            after = step(self.state, Event(what, now_ns, target, number, standing, findings))
            self.state = after.state
            if after.actions:
                act(after)
        return after

    def settled(self) -> "contextlib.AbstractContextManager[object]":
        """Keep everything from happening within the block."""
        return self._lock

    def is_newest(self, number: int) -> bool:
        """Return whether nothing has begun since the undertaking of this number."""
        return self.state.number == number

    def unproved(self, findings: Mapping[str, ResetFinding]) -> list[str]:
        """Return the targets that are not known to rest."""
        return list(unproved(self.state, findings))

    def permit(self, asked_ns: int) -> Permit:
        """Return the permit for a write that came in at that time (monotonic)."""
        return Permit(self, asked_ns)

    def objection_to(self, address: Address) -> str | None:
        """Return why an object must not be written now, whoever wants it and since when."""
        return LOCKED if address in self.locked and self.held else None
