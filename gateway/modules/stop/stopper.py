"""Stop of one drive: by quick stop; if it is not confirmed, by the allowed `[stop] fallback`."""

import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from dataclasses import replace

from drivers.bus.arming import ACTING
from drivers.joint.quick_stop import StopOutcome
from gateway.config.stop import Fallback
from gateway.modules.stop.drive import Drive, quick_stop
from gateway.modules.stop.target import OneAtATime, Report
from gateway.process.futures import done, then

Tell = Callable[[str, str], object]  # a drive's name, and what was done to it in words


class Stopper:
    """One drive."""

    def __init__(self, drive: Drive, fallbacks: Iterable[Fallback], tell: Tell) -> None:
        self.drive = drive
        self._fallbacks = frozenset(fallbacks)
        self._tell = tell
        self._stops = OneAtATime(lambda wake: then(quick_stop(self.drive, wake=wake), self._or_limp))

    @property
    def running(self) -> bool:
        return self._stops.running

    @property
    def idle_s(self) -> float:
        """Time since its last stop ended; 0 during one."""
        return 0.0 if self.running else time.monotonic() - self._stops.ended

    def stop(self, *, wake: bool = True) -> "Future[Report]":
        """Ask for it; the fallback that a drive can confirm follows by itself."""
        return self._stops.ask(wake=wake)

    def wake(self) -> None:
        self.drive.wake()

    def _or_limp(self, outcome: StopOutcome) -> "Future[Report]":
        if outcome is not StopOutcome.UNCONFIRMED or Fallback.DISABLE_VOLTAGE not in self._fallbacks:
            return done(Report(outcome))
        return then(self.drive.disable_voltage(), self._limp)

    def _limp(self, outcome: StopOutcome) -> Report:
        confirmed = outcome is StopOutcome.CONFIRMED
        result = (
            "its motor has no current: the joint is limp" if confirmed else "that is not confirmed either"
        )
        text = f"its quick stop was not confirmed, so its voltage was disabled; {result}"
        self._tell(self.drive.name, text)
        return Report(outcome, text)


def nmt_stop(drives: Iterable[Drive], reports: Mapping[str, Report], tell: Tell) -> dict[str, Report]:
    """Return the last resort, on each node none of whose axes has confirmed; what it does nobody confirms."""
    nodes: dict[int, list[Drive]] = {}
    for drive in drives:
        nodes.setdefault(id(drive.node), []).append(drive)
    after = dict(reports)
    for axes in nodes.values():
        if all(reports[axis.name].outcome is not StopOutcome.CONFIRMED for axis in axes):
            text = _stop_node(axes)
            for axis in axes:
                tell(axis.name, text)
                before = reports[axis.name]
                said = text if before.fallback is None else f"{before.fallback}; {text}"
                after[axis.name] = replace(before, fallback=said)
    return after


def _stop_node(axes: list[Drive]) -> str:
    options = [
        None if axis.reading is None else axis.reading.options.get("abort_connection") for axis in axes
    ]
    if not all(option in ACTING for option in options):
        said = ", ".join("unknown" if option is None else str(option) for option in options)
        return f"NMT stop was not sent: its 6007h is {said}, so it might only fall silent"
    axes[0].nmt_stop()
    return (
        "NMT stop was sent, which nothing confirms; it answers nothing until a master starts its node again"
    )
