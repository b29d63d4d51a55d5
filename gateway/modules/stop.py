"""The stop: quick stop on every drive at once, held until it is reset.

While it is held, a drive that is seen enabled again is stopped again, and a drive that cannot be seen is
asked again and again, because unknown is not stopped. Nothing here can enable a drive.
"""

import logging
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Protocol

from drivers.joint.cia402 import DriveState, drive_state
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.reading import DriveReading
from drivers.latest import Latest
from drivers.samples import Channel, Sample
from gateway.futures import failed, gather, outcome, then
from gateway.loop import Loop, Timer
from gateway.messages import StopOutcome as Said
from gateway.messages import Stopped

log = logging.getLogger(__name__)

ANSWER_S = 2.5  # a stop is answered within this time, whatever the drives do
WATCH_S = 0.25  # how often a held stop looks at drives that say nothing
SAY_AGAIN_S = 5.0  # how often one drive that is enabled again and again is logged


class Drive(Protocol):
    """What a stop needs of a joint's driver."""

    @property
    def name(self) -> str: ...

    @property
    def channels(self) -> tuple[Channel, ...]: ...

    @property
    def latest(self) -> Latest: ...

    @property
    def reading(self) -> DriveReading | None: ...

    def quick_stop(self) -> "Future[StopOutcome]": ...


class _Held:
    """One drive under a held stop."""

    def __init__(self, drive: Drive, loop: Loop) -> None:
        self.drive = drive
        self.again = 0  # how often it had to be stopped again
        self._loop = loop
        self._running: Future[StopOutcome] | None = None
        self._logged_ns = 0
        self._statusword = next(
            (i for i, channel in enumerate(drive.channels) if channel.quantity == "statusword"), None
        )
        self._end_listening = drive.latest.subscribe(self._on_sample)

    def close(self) -> None:
        self._end_listening()

    def stop(self) -> "Future[StopOutcome]":
        """Quick stop, once at a time; never raises."""
        if self._running is None or self._running.done():
            try:
                self._running = self.drive.quick_stop()
            except Exception as error:  # noqa: BLE001 - the other drives are to be stopped all the same
                self._running = failed(error)
        return self._running

    def look(self) -> None:
        """Stop again where the drive is enabled, or where nobody knows whether it is."""
        enabled = self._enabled()
        if enabled:
            self._on_enabled()
        elif enabled is None:
            self.stop()

    def _enabled(self) -> bool | None:
        if self._statusword is None:
            return None
        value, _stamp_ns = self.drive.latest.read(self._statusword, time.monotonic_ns())
        return None if value is None else is_enabled(value)

    def _on_sample(self, sample: Sample) -> None:
        """In the driver's thread: the loop stops the drive, this only tells it."""
        for index, value in zip(sample.indices, sample.values, strict=True):
            if index == self._statusword and value is not None and is_enabled(value):
                self._loop.post(self._on_enabled)

    def _on_enabled(self) -> None:
        if self._running is not None and not self._running.done():
            return
        self.again += 1
        now_ns = time.monotonic_ns()
        if now_ns - self._logged_ns > SAY_AGAIN_S * 1e9:
            self._logged_ns = now_ns
            log.warning("%s was enabled while the robot is stopped; stopping it again", self.drive.name)
        self.stop()


def is_enabled(statusword: float) -> bool:
    """Whether a statusword (6041h) says OPERATION ENABLED."""
    return drive_state(int(statusword)) is DriveState.OPERATION_ENABLED


class Stop:
    """The robot's stop. It belongs to the loop's thread."""

    def __init__(self, loop: Loop, drives: Mapping[str, Drive], absent: Mapping[str, str]) -> None:
        self.held = False
        self.reason: str | None = None
        self.since_ns: int | None = None
        self._loop = loop
        self._drives = drives
        self._absent = absent  # joints that could not be built
        self._holding: dict[str, _Held] = {}
        self._timer: Timer | None = None

    def stop(self, reason: str, when_ready: "Callable[[str], Future[None]]") -> "Future[Stopped]":
        """Stop every drive now, and each that only just comes up as soon as it is there.

        `when_ready` tells when a drive that was started a moment ago can be reached.
        """
        if not self.held:
            self.held, self.since_ns = True, time.monotonic_ns()
            self._holding = {name: _Held(drive, self._loop) for name, drive in self._drives.items()}
            self._timer = self._loop.call_later(WATCH_S, self._watch)
        self.reason = reason
        log.warning("quick stop on every drive: %s", reason or "no reason given")
        stops = {name: self._stop_one(held, when_ready(name)) for name, held in self._holding.items()}
        return self._answer_in_time(stops)

    @property
    def again(self) -> dict[str, int]:
        """How often each drive was enabled by somebody else and stopped again."""
        return {name: held.again for name, held in self._holding.items()}

    def close(self) -> None:
        """End the watch, as the process ends."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        for held in self._holding.values():
            held.close()

    def _stop_one(self, held: _Held, ready: "Future[None]") -> "Future[StopOutcome]":
        """Stop one drive; on a cold start the first attempt may come before its bus is open."""
        first = held.stop()
        if ready.done():
            return first
        both = gather({"first": then(first, lambda _outcome: None), "ready": ready})
        return then(both, lambda _both: self._second(held, first))

    def _second(self, held: _Held, first: "Future[StopOutcome]") -> "Future[StopOutcome]":
        return first if outcome(first) is StopOutcome.CONFIRMED else held.stop()

    def _answer_in_time(self, stops: "Mapping[str, Future[StopOutcome]]") -> "Future[Stopped]":
        answer: Future[Stopped] = Future()

        def tell() -> None:
            if not answer.done():
                timer.cancel()
                drives = {name: _said(future) for name, future in stops.items()}
                for name in self._absent:
                    drives[name] = "unreachable"
                answer.set_result(Stopped(drives, held=self.held))

        timer = self._loop.call_later(ANSWER_S, tell)
        gather(stops).add_done_callback(lambda _all: self._loop.call(tell))
        return answer

    def _watch(self) -> None:
        for held in self._holding.values():
            held.look()
        self._timer = self._loop.call_later(WATCH_S, self._watch)


_SAID: Mapping[StopOutcome, Said] = {
    StopOutcome.CONFIRMED: "confirmed",
    StopOutcome.UNCONFIRMED: "unconfirmed",
    StopOutcome.UNREACHABLE: "unreachable",
}


def _said(stop: "Future[StopOutcome]") -> Said:
    """What a drive has confirmed by now; one that has not answered yet is not confirmed."""
    if not stop.done():
        return "unconfirmed"
    found = outcome(stop)
    if isinstance(found, Exception):
        log.error("a quick stop failed", exc_info=found)
        return "unreachable"
    return _SAID[found]
