"""Writes in a robot's journal that are not this window's: by a command, another window, or an experiment."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from server_gui.core.desk.flags import FlagKind, of_recorded_journal
from server_gui.core.follow.news import NewsKind
from server_gui.core.follow.robot import Robot

Entry = dict[str, Any]
DONE: Final = frozenset({"write done", "trial begun"})


class WritesOfOthers:
    """Tells of each that succeeded, once; what was written before the journal was first read is no news."""

    def __init__(self, robot: Robot, tell: Callable[[NewsKind, str], None]) -> None:
        self._robot = robot
        self._tell = tell
        self._own: set[int] = set()
        self._asked: dict[int, Entry] = {}
        self._newest: int | None = None  # number of the newest entry that was read

    def own(self, write: int) -> None:
        """Note the number of a write of this window, by the robot's answer."""
        self._own.add(write)

    def take(self, entries: Sequence[Entry]) -> None:
        """Take the robot's newest entries, oldest first."""
        described = () if self._robot.description is None else self._robot.description.parameters
        for flag in of_recorded_journal(self._found(entries), described):
            on_trial = ", on trial" if flag.kind is FlagKind.TRIAL else ""
            self._tell(NewsKind.PARAMETER, f"{flag.text}{on_trial}")

    def _found(self, entries: Sequence[Entry]) -> Iterator[Entry]:
        """Yield the entries that began such a write."""
        told = [(number, one) for one in entries if isinstance(number := one.get("n"), int)]
        if not told:
            return
        before, self._newest = self._newest, told[-1][0]
        is_history = before is None or self._newest < before  # the first look, or another journal
        if is_history:
            self._own, self._asked = set(), {}
        for number, entry in told:
            write = entry.get("write")
            if not isinstance(write, int) or (not is_history and number <= (before or 0)):
                continue
            if entry.get("what") == "write":
                self._asked[write] = entry
            elif entry.get("what") in DONE:
                asked = self._asked.pop(write, None)
                if asked is not None and write not in self._own and not is_history:
                    yield asked
