"""How a robot is left that is removed from the window: nobody sees or stops it there any more."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.drive_states import any_enabled, listed, unknown_joints
from server_gui.core.alarms.texts import Kind, check_of
from server_gui.core.alarms.unconfirmed import unstopped
from server_gui.core.desk.station import Station
from server_gui.core.tuning.stop import StopState

GONE: Final = "this window cannot stop it any more"


@dataclass(frozen=True, slots=True)
class Left:
    """A robot that was removed, and the alarm of it."""

    alarm: Alarm
    station: Station

    def is_seen_in(self, stations: Iterable[Station]) -> bool:
        """Return whether the same robot is seen, and stopped, from here again.

        One that was not known to have stopped stays named: a robot that is added tells nothing of that STOP.
        """
        known, called = self.station.robot.description is not None, self.station.called
        live = (one for one in stations if one.is_live and one.address == self.station.address)
        is_same = any(one.called == called or not known for one in live)
        return is_same and self.alarm.kind is Kind.LEFT_RUNNING


def left_alarm(station: Station) -> Alarm | None:
    """Return the alarm of one that is removed now; None where every drive is known to be off."""
    robot, stopping = station.robot, station.stopping
    kind, unknown = Kind.LEFT_RUNNING, unknown_joints(robot)
    if unstopped(robot, stopping) is not None or stopping.state is StopState.SENT:
        kind, how = Kind.LEFT_UNSTOPPED, "while it was not known to have stopped"
    elif not station.is_live:
        how = "while it was not known whether its drives are enabled"
    elif any_enabled(robot):
        how = "while its drives were enabled"
    elif unknown:
        how = f"while the state of {listed(unknown)} was not known"
    else:
        return None
    return Alarm(kind, station.address, f"{how}; {GONE}", station.title, check=check_of(kind))
