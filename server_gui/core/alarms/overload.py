"""Overloaded computers, named first in what to check: their lateness looks like a broken cable."""

import dataclasses
from collections.abc import Iterable, Iterator
from typing import Final

from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.missing_pdos import BUSY_PERCENT
from server_gui.core.follow.robot import Robot

OURS: Final = "this computer is overloaded, end other programs on it first"
BOTH: Final = (
    "this computer and the robot's computer are overloaded, see what keeps them busy first (gwrms blame)"
)
THEIR_LOAD: Final = "the robot's computer is overloaded"
THEIRS: Final = f"{THEIR_LOAD}, see what keeps it busy first (gwrms blame)"
BLAMED: Final = (
    "a simulated robot has no wires: see what keeps this computer busy (gwrms blame), and "  # besides
)
UNPLUGGED: Final = ("does not exist", "went away")  # as drivers say of a port
ALSO: Final = "; also "  # begins what is to be checked besides
PARTS: Final = frozenset({Kind.NO_DATA, Kind.LOST, Kind.PART_STALE})
SILENT: Final = frozenset({Kind.NO_LINK, Kind.STALE}) | PARTS
BUSES: Final = frozenset({Kind.BUS, Kind.BUS_FAILS})  # frames that a busy computer does not take are missing


def overloaded(robot: Robot, *, is_ours: bool) -> tuple[str, ...]:
    """Return what to do first about each overloaded computer, as far as is known; never of a recording."""
    if robot.is_recording:
        return ()
    percent = robot.cpu_percent()
    is_theirs = percent is not None and percent >= BUSY_PERCENT
    return (*(THEIRS,) * is_theirs, *(OURS,) * is_ours)


def is_unplugged(alarm: Alarm) -> bool:
    """Return whether a driver says that its port is not there: no load takes one away."""
    return any(word in alarm.what for word in UNPLUGGED)


def is_common(alarms: Iterable[Alarm], parts: int) -> bool:
    """Return whether of so many parts half or more are late: a computer makes all of them so, a cable one."""
    return 2 * sum(one.kind in PARTS for one in alarms) >= parts


def load_first(alarms: Iterable[Alarm], first: tuple[str, ...], parts: int) -> Iterator[Alarm]:
    """Yield the alarms; of what is silent or stale the overloaded computers are checked first.

    Not of what is unplugged: no load takes a port away. Nor, where most of so many `parts` are well, of those
    that are not: a load makes all of them late, so it is named after what they alone may have. What an alarm
    says itself of the robot's computer is not said again.
    """
    found = list(alarms)
    late = [one for one in found if one.kind in SILENT | BUSES and not is_unplugged(one)]
    is_of_all = is_common(late, parts)
    every = first
    for one in found:
        first = tuple(said for said in every if said != THEIRS or THEIR_LOAD not in one.what)
        first = (BOTH,) if len(first) > 1 else first
        if not first or one not in late:
            yield one
        elif one.kind in PARTS and not is_of_all:
            also = (text.replace(" first", "") for text in first)
            yield dataclasses.replace(one, check=ALSO.join(filter(None, (_besides(one.check), *also))))
        else:
            yield dataclasses.replace(one, check="; then ".join(filter(None, (*first, _besides(one.check)))))


def _besides(check: str) -> str:
    """Return what is to be checked besides the load, which is named already."""
    return check.replace(BLAMED, "")
