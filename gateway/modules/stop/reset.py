"""Reset: leads every drive to SWITCH ON DISABLED, never further, and shows that nothing can move.

Controllers are stopped, then the drives are led down, all at once; then every drive and every controller is
read once more. Only what these last readings say is handed to the machine, which ends the hold or does not.
"""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from functools import partial

from drivers.joint.cia402 import DriveState
from drivers.joint.transitions import OVERTAKEN, Led
from gateway.modules.stop.controllers import Controllers
from gateway.modules.stop.drive import Drive
from gateway.modules.stop.machine import ResetFinding
from gateway.modules.stop.target import stop_all
from gateway.process.futures import back, done, failed, gather, then, within
from gateway.process.loop import Loop

# States in which a drive has no current; only what is known to be in one of them lets a hold end.
AT_REST = frozenset({DriveState.SWITCH_ON_DISABLED, DriveState.FAULT})
NOT_SINCE = "it was not read at rest since the last stop, or since it was last seen enabled or booting"
NOT_STOPPED = "it does not hold the value that stops it"
# How long a controller may take to tell: where one out of reach is asked to stop again and again, because it
# enables drives, its reading has no turn, and the reset must end for these to be watched as usual.
LOOK_S = 2.0
_UNREAD = ResetFinding(at_rest=False, asked_ns=0)


@dataclass(frozen=True, slots=True)
class Descent:
    """Result of a descent: each drive's state, the problems, and the last readings."""

    drives: dict[str, str]
    problems: dict[str, str]
    findings: dict[str, ResetFinding] = field(default_factory=dict)

    def with_problems(self, unproved: Iterable[str]) -> "Descent":
        """Each target that is not known to rest has its reason."""
        reasons = dict.fromkeys(unproved, NOT_SINCE)
        return replace(self, problems={**reasons, **self.problems})


class Lowering:
    """One way down of a robot. It belongs to the loop's thread. `absent` could not be built, and why."""

    def __init__(
        self, loop: Loop, drives: Mapping[str, Drive], absent: Mapping[str, str], controllers: Controllers
    ) -> None:
        self._loop = loop
        self._drives = drives
        self._absent = {**absent, **controllers.absent}
        self._joints = (*drives, *absent)
        self._controllers = controllers.targets

    def run(self, wanted: Callable[[], bool]) -> "Future[Descent]":
        """Lead all down as long as that is `wanted`, and read them."""
        quiet = back(self._loop, gather(stop_all(self._controllers)))  # nobody shall command against it
        led = then(quiet, lambda _reports: back(self._loop, gather(self._down(wanted))))
        return then(led, self._look)

    def _down(self, wanted: Callable[[], bool]) -> "dict[str, Future[Led]]":
        if not wanted():
            return {name: done(Led(None, OVERTAKEN)) for name in self._drives}
        return {name: _call(partial(drive.reset, wanted)) for name, drive in self._drives.items()}

    def _look(self, led: Mapping[str, Led | Exception]) -> "Future[Descent]":
        drives = back(self._loop, gather({name: _call(drive.look) for name, drive in self._drives.items()}))
        controllers = {
            name: within(self._loop, back(self._loop, one.look()), LOOK_S, _UNREAD)
            for name, one in self._controllers.items()
        }
        return then(
            drives,
            lambda seen: then(
                back(self._loop, gather(controllers)), lambda found: self._descent(led, seen, found)
            ),
        )

    def _descent(
        self,
        led: Mapping[str, Led | Exception],
        seen: Mapping[str, Led | Exception],
        found: Mapping[str, ResetFinding | Exception],
    ) -> Descent:
        last = {name: _last(as_led(led[name]), as_led(seen[name])) for name in self._drives}
        last |= {name: Led(None, self._absent[name]) for name in self._joints if name not in last}
        problems = {name: one.problem for name, one in last.items() if one.problem is not None}
        for name, one in found.items():
            if not isinstance(one, ResetFinding):
                problems[name] = str(one)
            elif not one.at_rest:
                problems[name] = f"it was not read within {LOOK_S:g} s" if one is _UNREAD else NOT_STOPPED
        problems |= {name: why for name, why in self._absent.items() if name not in last}
        findings = {name: ResetFinding(one.state in AT_REST, one.asked_ns) for name, one in last.items()}
        findings |= {name: one for name, one in found.items() if isinstance(one, ResetFinding)}
        return Descent({name: state_words(one.state) for name, one in last.items()}, problems, findings)


def _last(led: Led, seen: Led) -> Led:
    """Return its last reading; what its way down said stays the reason why it did not arrive."""
    overtaken = led.problem == OVERTAKEN and seen.state in AT_REST  # the stop has come to an end meanwhile
    problem = seen.problem or (None if overtaken else led.problem)
    if problem is None and seen.state not in (led.state, *AT_REST):
        problem = f"it was led to {state_words(led.state)}, and is in {state_words(seen.state)} now"
    return Led(seen.state, problem, asked_ns=seen.asked_ns)


def _call(ask: "Callable[[], Future[Led]]") -> "Future[Led]":
    try:
        return ask()
    except Exception as error:  # noqa: BLE001 - it is this drive's alone
        return failed(error)


def as_led(found: Led | Exception) -> Led:
    return found if isinstance(found, Led) else Led(None, str(found))


def state_words(state: DriveState | None) -> str:
    return "unknown" if state is None else state.words
