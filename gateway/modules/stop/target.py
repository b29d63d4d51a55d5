"""What a stop goes to, drives and controllers alike: each can be asked, and reports what is known then."""

from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Protocol

from drivers.joint.quick_stop import StopOutcome


@dataclass(frozen=True, slots=True)
class Report:
    """What is known about one target, and which fallback was carried out on it, in words."""

    outcome: StopOutcome
    fallback: str | None = None


class Target(Protocol):
    """One drive, or one controller."""

    def stop(self, *, wake: bool = True) -> "Future[Report]":
        """Ask it to stop, ahead of everything else that is asked of its node. Never raises."""

    def wake(self) -> None:
        """Follow what was asked for with `wake=False`."""


def stop_all(targets: Mapping[str, Target]) -> "dict[str, Future[Report]]":
    """Every request first, then those who wait for the answers."""
    stops = {name: target.stop(wake=False) for name, target in targets.items()}
    for target in targets.values():
        target.wake()
    return stops
