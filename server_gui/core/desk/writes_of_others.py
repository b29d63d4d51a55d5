"""Writes in a robot's journal that are not this window's: by a command, or by another window."""

import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from server_gui.core.alarms.marks import age_text
from server_gui.core.desk.flags import FlagKind, of_recorded_journal
from server_gui.core.follow.news import NewsKind
from server_gui.core.follow.robot import Robot

Entry = dict[str, Any]
ANSWERED_NS: Final = 2_000_000_000  # by then a write of this window has been answered
AT_ONCE: Final = 64  # writes, of which at most one is under way
LATE_S: Final = 10.0  # told later than that, it is said how long ago it was
DONE: Final = frozenset({"write done", "trial begun"})


class WritesOfOthers:
    """Tells of each that succeeded, once; what stood in the journal when it was first read is no news.

    The journal may be read before a write of this window is answered: each is told a little later.
    """

    def __init__(self, robot: Robot, tell: Callable[[NewsKind, str], None]) -> None:
        self._robot = robot
        self._tell = tell
        self._own: set[int] = set()
        self._asked: dict[int, Entry] = {}
        self._done: dict[int, tuple[int, Entry]] = {}  # when it was read, and the entry that began it
        self._newest: tuple[int, object] | None = None  # number and hash of the newest entry that was read

    def own(self, *writes: int) -> None:
        """Note the numbers of writes of this window, by the robot's answers."""
        self._own.update(writes)

    def _forget(self, write: int) -> None:
        """Forget writes of long ago that have come to nothing."""
        for old in [one for one in self._asked if one < write - AT_ONCE]:
            del self._asked[old]

    def look(self, now_ns: int) -> None:
        """Tell of those that nobody here has turned out to have asked for."""
        due = [write for write, (read_ns, _) in self._done.items() if now_ns - read_ns >= ANSWERED_NS]
        found = [self._done.pop(write)[1] for write in due]
        others = [entry for write, entry in zip(due, found, strict=True) if write not in self._own]
        described = () if self._robot.description is None else self._robot.description.parameters
        for flag in of_recorded_journal(others, described):
            on_trial = ", on trial" if flag.kind is FlagKind.TRIAL else ""
            ago_s = (time.time_ns() - flag.at_ns) / 1e9
            since = f", {age_text(ago_s)} ago" if ago_s > LATE_S else ""
            self._tell(NewsKind.PARAMETER, f"{flag.text}{on_trial}{since}")

    def take(self, entries: Sequence[Entry], now_ns: int) -> None:
        """Take the robot's newest entries, oldest first."""
        told = [(number, one) for one in entries if isinstance(number := one.get("n"), int)]
        if not told:
            return
        before, self._newest = self._newest, (told[-1][0], told[-1][1].get("hash"))
        # The first look, or another journal: also where nobody can tell that it goes on.
        is_history = before is None or before not in [(number, one.get("hash")) for number, one in told]
        read = 0 if before is None or is_history else before[0]
        for number, entry in told:
            write = entry.get("write")
            if not isinstance(write, int) or number <= read:
                continue
            self._forget(write)
            if entry.get("what") == "write":
                self._asked[write] = entry
            elif entry.get("what") in DONE:
                asked = self._asked.pop(write, None)
                if asked is not None and not is_history:
                    self._done[write] = now_ns, asked
