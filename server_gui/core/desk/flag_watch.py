"""Flags of a robot as its events come: of its drives' states, its journal, and its buses."""

from collections.abc import Iterator

from server_gui.core.desk.flags import Flag, FlagKind, StateWatch, of_journal
from server_gui.core.follow.events import BusesSeen, Event, Journalled, Telemetry
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.bus_turns import BusTurns


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
                yield from of_journal(event.journal.entries, robot.description.boot_id)
            case BusesSeen():
                found = self._buses.take(robot.buses, event.at_ns)
                if newest_ns is not None:
                    yield from (Flag(newest_ns, text, FlagKind.BUS) for text in found)
