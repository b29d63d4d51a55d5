"""The course of a stop: a second try on a cold start, the last resort, the answer in time.

The stop acts first, in a thread of its own; here, in the loop, is only told what came of it.
"""

import logging
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from typing import Any

from drivers.joint.quick_stop import StopOutcome
from gateway.config.robot import RobotConfig
from gateway.config.stop import Fallback
from gateway.modules.stop.controllers import Controllers
from gateway.modules.stop.stopper import Stopper, Tell, nmt_stop
from gateway.modules.stop.target import Report, StopTarget
from gateway.process.futures import back, done, gather, outcome, then
from gateway.process.loop import Loop
from gateway.wire.stop import StopOutcome as Said
from gateway.wire.stop import Stopped

log = logging.getLogger(__name__)

WhenReady = Callable[[str], "Future[None]"]
Kept = Future[str | None]  # why it is not held beyond this gateway
OUTDATED = (
    "{}; stopped were the drives of the robot's file as it was valid last: assume that any other still moves"
)


class StopAnswers:
    """One robot's. It belongs to the loop's thread. `absent` are drives that could not be built.

    `when_ready` tells when a component that was started a moment ago can be reached.
    """

    def __init__(
        self,
        loop: Loop,
        config: RobotConfig,
        stoppers: Mapping[str, Stopper],
        absent: Iterable[str],
        controllers: Controllers,
        when_ready: WhenReady,
        tell: Tell,
    ) -> None:
        self._loop = loop
        self._settings = config.stop
        self._outdated = OUTDATED.format(config.outdated) if config.outdated else None
        self._stoppers = stoppers
        self._controllers = controllers
        self._targets: Mapping[str, StopTarget] = {**stoppers, **controllers.targets}
        self._unreachable = {name: Report(StopOutcome.UNREACHABLE) for name in (*absent, *controllers.absent)}
        self._when_ready = when_ready
        self._tell = tell

    def follow(self, first: "Mapping[str, Future[Report]]", kept: Kept | None) -> "Future[Stopped]":
        """Return the answer to a stop that was asked of every target a moment ago."""
        stops = {name: self._once_more(name, stop) for name, stop in first.items()}
        drives = {name: stop for name, stop in stops.items() if name in self._stoppers}
        last = then(back(self._loop, gather(drives)), self._last_resort)
        return self._answer_in_time(stops, last, kept or done(None))

    def _once_more(self, name: str, first: "Future[Report]") -> "Future[Report]":
        """Stop once more: on a cold start the first attempt may precede the bus; one confirmed is enough."""
        ready = self._when_ready(name)
        if ready.done():
            return first

        def again(_tried: object) -> "Future[Report]":
            return first if _is_confirmed(first) else then(ready, lambda _none: self._targets[name].stop())

        return then(gather({"first": first}), again)

    def _last_resort(self, found: Mapping[str, Report | Exception]) -> dict[str, Report]:
        reports = {name: _report(one) for name, one in found.items()}
        if Fallback.NMT_STOP not in self._settings.fallback:
            return reports
        return nmt_stop((stopper.drive for stopper in self._stoppers.values()), reports, self._tell)

    def _answer_in_time(
        self, stops: "Mapping[str, Future[Report]]", last: "Future[dict[str, Report]]", kept: Kept
    ) -> "Future[Stopped]":
        answer: Future[Stopped] = Future()

        def tell() -> None:
            if not answer.done():
                timer.cancel()
                answer.set_result(self._answer(_so_far(stops, last), kept))

        timer = self._loop.call_later(self._settings.timeout_s, tell)
        everything: dict[str, Future[Any]] = {**stops, "last resort": last, "hold kept": kept}
        gather(everything).add_done_callback(lambda _all: self._loop.call(tell))
        return answer

    def _answer(self, found: Mapping[str, Report], kept: Kept) -> Stopped:
        controllers, reports = self._controllers.names, {**found, **self._unreachable}
        said: dict[str, Said] = {name: report.outcome.value for name, report in reports.items()}
        return Stopped(
            drives={name: one for name, one in said.items() if name not in controllers},
            held=True,
            controllers={name: one for name, one in said.items() if name in controllers},
            fallbacks={name: one.fallback for name, one in reports.items() if one.fallback is not None},
            problem=kept.result() if kept.done() else "nobody knows yet whether it outlives this gateway",
            outdated=self._outdated,
        )


def _is_confirmed(stop: "Future[Report]") -> bool:
    report: Report | Exception = outcome(stop)
    return isinstance(report, Report) and report.outcome is StopOutcome.CONFIRMED


def _so_far(stops: "Mapping[str, Future[Report]]", last: "Future[dict[str, Report]]") -> dict[str, Report]:
    """Return the reports so far; a target without an answer yet is unconfirmed."""
    reports = dict.fromkeys(stops, Report(StopOutcome.UNCONFIRMED))
    for name, stop in stops.items():
        if stop.done():
            found: Report | Exception = outcome(stop)
            reports[name] = _report(found)
    if not last.done():
        return reports
    after: dict[str, Report] | Exception = outcome(last)
    if isinstance(after, Exception):
        log.error("the last resort of a stop failed", exc_info=after)
        return reports
    return reports | after


def _report(found: Report | Exception) -> Report:
    if isinstance(found, Report):
        return found
    log.error("a stop failed", exc_info=found)
    return Report(StopOutcome.UNREACHABLE)
