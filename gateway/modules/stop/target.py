"""Targets of a stop, drives and controllers alike: each takes a request and reports."""

import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Protocol

from drivers.joint.quick_stop import StopOutcome
from gateway.process.futures import pass_on


@dataclass(frozen=True, slots=True)
class Report:
    """Report on one target, with the fallback that was carried out, in words."""

    outcome: StopOutcome
    fallback: str | None = None


class StopTarget(Protocol):
    """One drive, or one controller."""

    @property
    def running(self) -> bool:
        """Whether a stop of it is under way."""

    def stop(self, *, wake: bool = True) -> "Future[Report]":
        """Ask it to stop, ahead of everything else that is asked of its node. Never raises."""

    def wake(self) -> None:
        """Follow what was asked for with `wake=False`."""


def stop_all(targets: Mapping[str, StopTarget]) -> "dict[str, Future[Report]]":
    """Every request first, then those who wait for the answers."""
    stops = {name: target.stop(wake=False) for name, target in targets.items()}
    for target in targets.values():
        target.wake()
    return stops


class OneAtATime:
    """Stops one target once at a time; for any thread.

    A stop that comes meanwhile follows, once for all who ask for it: what the first one confirms was perhaps
    read before the later one was asked for.
    """

    def __init__(self, begin: "Callable[[bool], Future[Report]]") -> None:
        """`begin(wake)` asks, and never raises."""
        self._begin = begin
        self._lock = threading.Lock()
        self._running: Future[Report] | None = None
        self._next: Future[Report] | None = None
        self.ended = 0.0  # when the last one did, on the monotonic clock

    @property
    def running(self) -> bool:
        return self._running is not None

    def ask(self, *, wake: bool) -> "Future[Report]":
        """Begin, or follow what is under way."""
        with self._lock:
            if self._running is not None:
                self._next = self._next or Future()
                return self._next
            report = self._running = Future()
        self._run(report, wake=wake)
        return report

    def _run(self, report: "Future[Report]", *, wake: bool) -> None:
        self._begin(wake).add_done_callback(lambda found: self._ended(report, found))

    def _ended(self, report: "Future[Report]", found: "Future[Report]") -> None:
        with self._lock:
            self.ended = time.monotonic()
            following = self._running = self._next
            self._next = None
        pass_on(found, report)
        if following is not None:
            self._run(following, wake=True)
