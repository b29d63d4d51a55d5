"""The watch over a held stop: what is enabled again is stopped again, and what is not seen is asked again.

Unknown is not stopped. It works in the stop's own thread; drives are seen in the threads that receive them.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Any

from drivers.bus.emcy import Emcy
from drivers.errors import DriverError
from drivers.samples import Sample
from gateway.modules.stop.authority import Authority
from gateway.modules.stop.controllers import Controller
from gateway.modules.stop.drive import Drive, is_enabled
from gateway.modules.stop.machine import Input, Phase, ResetFinding
from gateway.modules.stop.stopper import Stopper
from gateway.modules.stop.target import StopTarget, stop_all
from gateway.process.futures import outcome

log = logging.getLogger(__name__)

# How often drives are looked at that say nothing by themselves; how long a node is left between two stops of
# what is not seen, too, so that it can come up and tell: an unconfirmed stop keeps it busy to its end.
LOOK_S = 0.25
AT_LEAST_S = 1.0  # how often what is not seen is asked to stop, whatever keeps its node busy
CONTROLLERS_S = 1.0  # how often a controller is read whether it is still stopped
SAY_AGAIN_S = 5.0  # how often one target that is started again and again is told

# Somebody leads the drives down: a stop of what cannot be seen would only overtake that.
_LED = (Phase.RESETTING, Phase.RELEASING)


class StopWatch:
    """Over all drives and controllers, between `begin` and `end`; both idempotent, for any thread.

    `happened(what, target, stamp_ns)` is told at once what was seen, in the thread that saw it, and
    `tell(target, times)` now and then of each that had to be stopped again.
    """

    def __init__(
        self,
        authority: Authority,
        stoppers: Mapping[str, Stopper],
        controllers: Mapping[str, Controller],
        happened: Callable[[Input, str, int], object],
        tell: Callable[[str, int], object],
    ) -> None:
        self._authority = authority
        self._stoppers = stoppers
        self._controllers = controllers
        self._happened = happened
        self._tell = tell
        self._lock = threading.Lock()
        self._ends: list[Callable[[], None]] | None = None
        self._times: dict[str, int] = {}
        self._silent_until: dict[str, float] = {}
        self._controllers_due = 0.0
        self._looking: set[str] = set()  # controllers whose answer is awaited

    @property
    def again(self) -> dict[str, int]:
        """Number of times that each drive was enabled by others and stopped again during this stop."""
        return {name: self._times.get(name, 0) for name in self._stoppers} if self._authority.held else {}

    def begin(self) -> None:
        with self._lock:
            if self._ends is None:
                self._times = {}
                listening = [end for name, one in self._stoppers.items() for end in self._listen(name, one)]
                boots = [self._hear_boots(name, one.node) for name, one in self._controllers.items()]
                self._ends = [*listening, *boots]

    def end(self) -> None:
        with self._lock:
            ends, self._ends = self._ends or [], None
        for one in ends:
            one()

    def look(self) -> None:
        """See what says nothing by itself. In the stop's thread."""
        if not self._authority.held:
            return
        asks = self._authority.state.phase not in _LED
        unseen: list[Stopper] = []
        for name, stopper in self._stoppers.items():
            self._look_at(name, stopper, unseen, asks=asks)
        for stopper in unseen:
            stopper.stop()
        if time.monotonic() >= self._controllers_due:
            self._controllers_due = time.monotonic() + CONTROLLERS_S
            for name, controller in self._controllers.items():
                self._read(name, controller)

    def stop_again(self, name: str) -> None:
        """One that was seen enabled or running, and its controllers with it. In the stop's thread."""
        target: StopTarget = self._stoppers.get(name) or self._controllers[name]
        if target.running:
            return
        self._times[name] = self._times.get(name, 0) + 1
        stop_all({**self._controllers, name: target})
        if time.monotonic() >= self._silent_until.get(name, 0.0):
            self._silent_until[name] = time.monotonic() + SAY_AGAIN_S
            self._tell(name, self._times[name])

    def _is_left_alone(self, stopper: Stopper) -> bool:
        """Return whether no axis of its node was asked to stop for a while; or itself for long."""
        node = stopper.drive.node
        return stopper.idle_s >= AT_LEAST_S or all(
            one.idle_s >= LOOK_S for one in self._stoppers.values() if one.drive.node is node
        )

    def _look_at(self, name: str, stopper: Stopper, unseen: list[Stopper], *, asks: bool) -> None:
        index = _statusword(stopper.drive)
        now_ns = time.monotonic_ns()
        value, stamp_ns = (None, None) if index is None else stopper.drive.latest.read(index, now_ns)
        if value is not None and is_enabled(value):
            self._seen(name, stamp_ns or now_ns)
        elif value is None and asks and self._is_left_alone(stopper):
            unseen.append(stopper)

    def _read(self, name: str, controller: Controller) -> None:
        if name not in self._looking and not controller.running:
            self._looking.add(name)
            controller.look().add_done_callback(lambda seen: self._found(name, controller, seen))

    def _found(self, name: str, controller: Controller, seen: Future[ResetFinding]) -> None:
        """In the thread of the controller's node."""
        self._looking.discard(name)
        found = outcome(seen)
        if isinstance(found, ResetFinding):
            if not found.at_rest:
                self._seen(name, found.asked_ns)
        elif isinstance(found, DriverError):
            controller.stop()
        else:
            log.error("looking at %s failed", name, exc_info=found)

    def _listen(self, name: str, stopper: Stopper) -> Iterator[Callable[[], None]]:
        drive = stopper.drive
        yield drive.latest.subscribe(partial(self._on_sample, name, _statusword(drive)))
        yield self._hear_boots(name, drive.node)

    def _hear_boots(self, name: str, node: Any) -> Callable[[], None]:
        end: Callable[[], None] = node.life.subscribe(_Boots(partial(self._happened, Input.LOST, name)))
        return end

    def _on_sample(self, name: str, statusword: int | None, sample: Sample) -> None:
        """In the driver's thread."""
        for index, value in zip(sample.indices, sample.values, strict=True):
            if index == statusword and value is not None and is_enabled(value):
                self._seen(name, sample.stamp_ns)

    def _seen(self, name: str, stamp_ns: int) -> None:
        self._happened(Input.SEEN, name, stamp_ns)


@dataclass(frozen=True, slots=True)
class _Boots:
    """Hears that a node has booted anew: whatever was read of it before says nothing now."""

    on_boot_up: Callable[[int], object]

    def on_emcy(self, emcy: Emcy) -> None:
        """Ignore an EMCY: it says nothing about rest."""


def _statusword(drive: Drive) -> int | None:
    return next((i for i, channel in enumerate(drive.channels) if channel.quantity == "statusword"), None)
