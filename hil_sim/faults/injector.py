"""Makes faults in one robot: checks what is asked for, begins it, ends it when its time is over."""

import difflib
import random
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from hil_sim.clock import SECOND_NS, Event
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.faults.fault import Fault, FaultRefused, Site, Value
from hil_sim.faults.registry import FAULTS

LONGEST_S = 1e6


@dataclass(frozen=True, slots=True)
class Active:
    """A fault that is on; times in simulated seconds, `until_s` is `None` where nobody said how long."""

    name: str
    on: str
    since_s: float
    until_s: float | None
    values: Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class _Running:
    shown: Active
    ending: ExitStack
    timer: Event | None


class Faults:
    """The faults of `robot`; used by the one thread that runs its clock.

    Randomness comes from `seed`, the fault, its device and how many there were before: the same faults at the
    same times disturb the same way. `home` is a folder that faults may use.
    """

    def __init__(self, robot: Exoskeleton, home: Path, seed: int = 0) -> None:
        self._robot = robot
        self._home = home
        self._seed = seed
        self._begun = 0
        self._running: dict[tuple[str, str], _Running] = {}

    @property
    def active(self) -> list[Active]:
        """Active faults, oldest first."""
        return [running.shown for running in self._running.values()]

    def begin(
        self,
        name: str,
        on: str | None = None,
        for_s: float | None = None,
        params: Mapping[str, object] | None = None,
    ) -> Active:
        """Make a fault on a device, for so many simulated seconds or until it is cleared.

        Raises:
            FaultRefused: there is no such fault, device or value, or it is on already.

        """
        fault, device, values = check_fault(name, on, for_s, params or {})
        if device in self._robot.without:
            raise FaultRefused(f"{device} is not simulated here: {name} can only be on what is")
        if (name, device) in self._running:
            raise FaultRefused(f"{name} is already on {device}; clear it first")
        self._begun += 1
        source = random.Random(f"{self._seed} {name} {device} {self._begun}")
        ending = ExitStack()
        ending.enter_context(fault.act(Site(self._robot, device, values, source, self._home)))
        now_s = self._robot.clock.now_s
        if fault.momentary:
            ending.close()
            return Active(name, device, now_s, now_s, values)
        active = Active(name, device, now_s, None if for_s is None else now_s + for_s, values)
        self._running[name, device] = _Running(active, ending, self._timer(active))
        return active

    def clear(self, name: str | None = None, on: str | None = None) -> list[Active]:
        """End the faults of that name and on that device, of any where none is given; says which."""
        ended = [active for active in self.active if name in (None, active.name) and on in (None, active.on)]
        for active in ended:
            self._end(active)
        return ended

    def _timer(self, active: Active) -> Event | None:
        if active.until_s is None:
            return None
        return self._robot.clock.at(round(active.until_s * SECOND_NS), lambda: self._end(active))

    def _end(self, active: Active) -> None:
        running = self._running.pop((active.name, active.on))
        if running.timer is not None:
            running.timer.cancel()
        running.ending.close()


def find(name: object) -> Fault:
    """Return the fault of a name; raises `FaultRefused` with the name that is near."""
    if isinstance(name, str) and name in FAULTS:
        return FAULTS[name]
    raise FaultRefused(f"there is no fault {name!r}: {_meant(name, FAULTS)}gwrms sim-fault --list shows all")


def _meant(word: object, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(str(word), list(known), 1)
    return f"did you mean {near[0]!r}? " if near else ""


def check_fault(
    name: object, on: object, for_s: object, params: Mapping[str, object]
) -> tuple[Fault, str, dict[str, Value]]:
    """Return the kind of fault, the device, and every parameter's value; raises `FaultRefused`."""
    fault = find(name)
    _check_duration(name, fault, for_s)
    return fault, _device(name, fault, on), _values(name, fault, params)


def _device(name: object, fault: Fault, on: object) -> str:
    allowed: tuple[str, ...] = fault.on.value
    if on is None and len(allowed) == 1:
        return allowed[0]
    if isinstance(on, str) and on in allowed:
        return on
    said = "needs to be told where" if on is None else f"cannot be on {on!r}"
    raise FaultRefused(f"{name} {said}: {_meant(on, allowed)}on is one of {', '.join(allowed)}")


def _values(name: object, fault: Fault, given: Mapping[str, object]) -> dict[str, Value]:
    for key in given:
        if key not in fault.parameters:
            known = f"it has {', '.join(fault.parameters) or 'none'}"
            raise FaultRefused(f"{name} has no parameter {key!r}: {_meant(key, fault.parameters)}{known}")
    return {
        key: parameter.check(f"{name}: {key}", given.get(key, parameter.default))
        for key, parameter in fault.parameters.items()
    }


def _check_duration(name: object, fault: Fault, for_s: object) -> None:
    if for_s is None:
        return
    if fault.momentary:
        raise FaultRefused(f"{name} is over as soon as it has begun; leave for_s out")
    if isinstance(for_s, bool) or not isinstance(for_s, int | float) or not 0 < for_s <= LONGEST_S:
        raise FaultRefused(f"for_s = {for_s!r} is no time: give seconds greater than 0")
