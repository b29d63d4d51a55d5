"""Writes in a robot's journal that are not this window's: by a command, another window, or an experiment."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

Entry = Mapping[str, Any]
DONE: Final = frozenset({"write done", "trial begun"})


class WritesOfOthers:
    """Finds each that succeeded, once; what was written before the journal was first read is no news."""

    def __init__(self) -> None:
        self._own: set[int] = set()
        self._asked: dict[int, Entry] = {}
        self._newest: int | None = None  # number of the newest entry that was read

    def own(self, write: int) -> None:
        """Note the number of a write of this window, by the robot's answer."""
        self._own.add(write)

    def take(self, entries: Sequence[Entry]) -> Iterator[Entry]:
        """Yield the entries that began such a write; `entries` are the newest, oldest first."""
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
