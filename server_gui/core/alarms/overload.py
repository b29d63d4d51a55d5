"""Overloaded computers, named first in what to check: their lateness looks like a broken cable."""

import dataclasses
from collections.abc import Iterable, Iterator
from typing import Final

from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.missing_pdos import BUSY_PERCENT
from server_gui.core.follow.robot import Robot

OURS: Final = "this computer is overloaded, end other programs on it first"
THEIRS: Final = "the robot's computer is overloaded, see what keeps it busy first (gwrms blame)"
UNPLUGGED: Final = "does not exist"  # as drivers say of a port
SILENT: Final = frozenset({Kind.NO_LINK, Kind.STALE, Kind.NO_DATA, Kind.LOST, Kind.PART_STALE})


def overloaded(robot: Robot, *, is_ours: bool) -> tuple[str, ...]:
    """Return what to do first about each overloaded computer, as far as is known; never of a recording."""
    if robot.is_recording:
        return ()
    percent = robot.cpu_percent()
    is_theirs = percent is not None and percent >= BUSY_PERCENT
    return (*(THEIRS,) * is_theirs, *(OURS,) * is_ours)


def load_first(alarms: Iterable[Alarm], first: tuple[str, ...]) -> Iterator[Alarm]:
    """Yield the alarms; of what is silent or stale the overloaded computers are checked first.

    Not of what is unplugged: no load takes a port away.
    """
    for one in alarms:
        if first and one.kind in SILENT and UNPLUGGED not in one.what:
            yield dataclasses.replace(one, check="; then ".join(filter(None, (*first, one.check))))
        else:
            yield one
