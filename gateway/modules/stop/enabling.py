"""Enables drives, as the master of their bus: one transition at a time, each confirmed before the next.

All chosen drives make one transition together; whatever comes in between, a stop above all, ends it, and what
was begun is stopped.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import Future

from drivers.joint.cia402 import MODES, DriveState, option_text
from drivers.joint.commands import WAY_UP
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.transitions import Led
from gateway.modules.stop.drive import Drive, quick_stop
from gateway.modules.stop.reset import as_led, state_words
from gateway.process.futures import back, done, failed, gather, then
from gateway.process.loop import Loop
from gateway.records.journal import Journal
from gateway.wire.stop import Enabled

Objection = Callable[[], str | None]  # why it must not go on, `None` where it may


class Enabling:
    """One way up of some drives. It belongs to the loop's thread."""

    def __init__(
        self,
        loop: Loop,
        drives: Mapping[str, Drive],
        who: str,
        objection: Objection,
        wanted: Callable[[], bool],
        journal: Journal,
    ) -> None:
        """`wanted`, asked from any thread, is false from the moment in which a stop overtakes it."""
        self._loop = loop
        self._drives = drives
        self._who = who
        self._objection = objection
        self._wanted = wanted
        self._journal = journal
        self._led: dict[str, Led] = {}
        self._begun: dict[str, Drive] = {}  # those that were not enabled before
        self._modes: dict[str, str] = {}

    def run(self) -> "Future[Enabled]":
        """Lead them up; the answer says where each is, and why not further."""
        return self._stage(list(WAY_UP))

    def _stage(self, left: list[DriveState]) -> "Future[Enabled]":
        """One transition of all drives, then the next."""
        objection = self._objection()
        if objection is not None:
            return self._give_up(dict.fromkeys(self._drives, objection))
        if not left:
            return done(self._told({}))
        steps = {name: _step(drive, left[0], self._wanted) for name, drive in self._drives.items()}
        return then(back(self._loop, gather(steps)), lambda found: self._next(found, left[1:]))

    def _next(self, found: Mapping[str, Led | Exception], left: list[DriveState]) -> "Future[Enabled]":
        first = not self._led
        self._led = {name: as_led(one) for name, one in found.items()}
        if first:
            up = DriveState.OPERATION_ENABLED
            self._begun = {name: one for name, one in self._drives.items() if self._led[name].state is not up}
        modes = {name: led.mode for name, led in self._led.items() if led.mode is not None}
        self._modes |= {name: option_text(MODES, mode) for name, mode in modes.items()}
        problems = {name: led.problem for name, led in self._led.items() if led.problem is not None}
        return self._give_up(problems) if problems else self._stage(left)

    def _give_up(self, problems: dict[str, str]) -> "Future[Enabled]":
        """Stop what was begun, and say what came of that."""
        stops = back(self._loop, gather(_quick_stop_all(self._begun)))
        return then(stops, lambda found: self._given_up(problems, found))

    def _given_up(self, problems: dict[str, str], stops: Mapping[str, object]) -> "Future[Enabled]":
        """Read once more where the drives are now."""
        seen = {name: _call(drive.look) for name, drive in self._drives.items()}
        return then(back(self._loop, gather(seen)), lambda found: self._seen(problems, stops, found))

    def _seen(
        self, problems: dict[str, str], stops: Mapping[str, object], found: Mapping[str, Led | Exception]
    ) -> Enabled:
        self._led = {name: as_led(one) for name, one in found.items()}
        others = "another drive was not led there"
        stopped = {
            name: f"{problems.get(name, others)}; its quick stop: {one}" for name, one in stops.items()
        }
        return self._told({**problems, **stopped})

    def _told(self, problems: dict[str, str]) -> Enabled:
        drives = {name: state_words(led.state) for name, led in self._led.items()}
        what = "not enabled" if problems else "enabled"
        more = {"problems": problems} if problems else {}
        self._journal.append(self._who, what, result=drives, modes=self._modes, **more)
        return Enabled(drives, problems, self._modes)


def _quick_stop_all(drives: Mapping[str, Drive]) -> "dict[str, Future[StopOutcome]]":
    """Every controlword first, then those who wait for the answers."""
    stops = {name: quick_stop(drive, wake=False) for name, drive in drives.items()}
    for drive in drives.values():
        drive.wake()
    return stops


def _step(drive: Drive, origin: DriveState, wanted: Callable[[], bool]) -> "Future[Led]":
    return _call(lambda: drive.step_up(origin, wanted))


def _call(ask: "Callable[[], Future[Led]]") -> "Future[Led]":
    try:
        return ask()
    except Exception as error:  # noqa: BLE001 - it is this drive's alone, and ends the way of all
        return failed(error)
