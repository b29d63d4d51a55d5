"""Flags of a robot as its events come: of its drives' states, its journal, and its buses."""

import time
from collections.abc import Iterator

from server_gui.core.desk.flags import Flag, FlagKind, StateWatch, of_journal
from server_gui.core.follow.events import BusesSeen, Event, Journalled, Telemetry
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.bus_turns import BusTurns
from server_gui.core.tuning.stop import StopProgress


def of_stop(stopping: StopProgress, newest_ns: int | None, age_s: float | None) -> Iterator[Flag]:
    """Yield a STOP that is not confirmed, on the axis of rows whose newest is so old: it may be in a gap."""
    if stopping.is_unproven and None not in (stopping.at_ns, newest_ns, age_s):
        ago_ns = time.monotonic_ns() - (stopping.at_ns or 0)
        at_ns = (newest_ns or 0) + round((age_s or 0.0) * 1e9) - ago_ns
        yield Flag(at_ns, f"STOP NOT CONFIRMED: {stopping.why}", FlagKind.UNPROVEN)


class FlagWatch:
    """For one boot of a robot; remembers how its drives and buses were."""

    def __init__(self) -> None:
        self._states = StateWatch()
        self._buses = BusTurns()

    def take(self, event: Event, robot: Robot, newest_ns: int | None) -> Iterator[Flag]:
        """Yield what an event brings that `robot` has taken; `newest_ns` is of its newest row."""
        match event:
            case Telemetry():
                yield from self._states.take(event.batch.stamps_ns, event.batch.columns, robot.state_words)
            case Journalled() if robot.description is not None:
                described = robot.description
                yield from of_journal(event.journal.entries, described.boot_id, described.parameters)
            case BusesSeen():
                found = self._buses.take(robot.buses, event.at_ns)
                if newest_ns is not None:
                    yield from (Flag(newest_ns, text, FlagKind.BUS) for text in found)
