"""The instant that signals stand still around: what had happened, and what after it is still to come."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from server_gui.core.desk.flags import Flag, FlagKind
from server_gui.core.desk.station import Station
from server_gui.core.workspace.scene import KEPT_S, Scene
from server_gui.views.workspace.tools import SPANS_S

SAME_S: Final = 1e-4  # rows that are no further apart are one
Span = tuple[float, float]  # s until the newest row


@dataclass(slots=True)
class Jump:
    """`comes`: what lies within `around_s` after it has not all come, and is shown as it does."""

    at_ns: int  # on the robot's clock
    read_ns: int  # of the row that is read: of a fault the one before, which shows what led to it
    around_s: float
    flags: list[Flag]  # what had happened in what was kept then
    comes: bool
    shown: Span = (0.0, 0.0)  # of the time, as it was shown by itself

    def window(self, newest_ns: int, span_s: float) -> Span:
        """Return the time around it, as far as it has come, within the last `span_s`."""
        at = (self.at_ns - newest_ns) / 1e9
        return max(at - self.around_s, -span_s), min(at + self.around_s, 0.0)

    def take_more(self, scene: Scene, station: Station, seen: Span) -> bool:
        """Keep what has come since; whether there is more to show.

        No more comes once somebody looks elsewhere than at what was shown, or the robot has begun anew.
        """
        newest_ns, frozen = station.rings.newest_ns, scene.frozen
        if not self.comes or newest_ns is None:
            return False
        if frozen is None or frozen.source is not station.rings.source or seen != self.shown:
            self.comes = False
            return False
        if newest_ns == frozen.newest_ns:
            return False
        around_ns = round(self.around_s * 1e9)
        end_ns, first = self.at_ns + around_ns, station.rings.times(KEPT_S)[0]
        if first > max(station.rings.seconds(self.at_ns - around_ns), frozen.times[0]):
            self.comes = False  # what is shown of before is no longer kept
            return False
        scene.freeze(station.rings.seconds(end_ns))
        self.flags = list(dict.fromkeys([*self.flags, *station.flags]))
        self.comes = newest_ns < end_ns
        return True


def jump_to(scene: Scene, station: Station, stamp_ns: int, around_s: float) -> Jump | None:
    """Return the jump to an instant of what stands still; None where that is gone by now."""
    frozen = scene.frozen
    if frozen is None or not len(frozen.times):
        return None
    at = (stamp_ns - frozen.newest_ns) / 1e9
    if not frozen.times[0] - frozen.times[-1] <= at <= 0.0:
        return None
    comes = at + around_s > 0.0 and not station.robot.is_recording
    read_ns, flags = stamp_ns, list(station.flags)
    if any(one.kind is FlagKind.FAULT and one.at_ns == stamp_ns for one in flags):
        row = int(np.searchsorted(frozen.times - frozen.times[-1], at - SAME_S)) - 1
        read_ns += round((frozen.times[row] - frozen.times[-1] - at) * 1e9) if row >= 0 else 0
    return Jump(stamp_ns, read_ns, around_s, flags, comes)


def event_beside(jump: Jump | None, station: Station, way: int) -> Flag | None:
    """Return the event after (`way` 1) or before (-1) where one has jumped to, else the newest row."""
    here_ns = (station.rings.newest_ns or 0) + 1 if jump is None else jump.at_ns
    flags = [one for one in station.flags if (one.at_ns - here_ns) * way > 0]
    return (flags[0] if way > 0 else flags[-1]) if flags else None


def happened(jump: Jump | None, station: Station, noted: Iterable[Flag], newest_ns: int) -> list[Flag]:
    """Return what has happened by `newest_ns` within the longest time that is shown."""
    begin_ns, past = newest_ns - round(SPANS_S[-1] * 1e9), [] if jump is None else jump.flags
    known = dict.fromkeys([*past, *station.flags.between(begin_ns, newest_ns + 1)])
    return [*known, *(one for one in noted if begin_ns <= one.at_ns <= newest_ns)]
