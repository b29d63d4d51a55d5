"""A robot's journal at the desk: who did what to it, bounded, and whether the entries hang together."""

import collections
from collections.abc import Iterator, Sequence
from typing import Any, Final

import msgspec

from gateway.records.chain import Broken, Head, check
from server_gui.core.recording.journal_tail import news
from server_gui.core.recording.rows import JournalHead

Entry = dict[str, Any]
KEPT: Final = 5000  # entries


class Audit:
    """The newest `KEPT` entries, oldest first; `revision` rises with every change.

    Each entry is checked as it comes: its own hash, and that it follows the one before (`problem` says where
    it does not). Entries that came too fast to be seen are `missing`.
    """

    def __init__(self) -> None:
        self.entries: collections.deque[Entry] = collections.deque(maxlen=KEPT)
        self.problem: str | None = None
        self.missing = 0
        self.revision = 0
        self._head: Head | None = None

    def take(self, entries: Sequence[Entry]) -> None:
        """Take the robot's newest entries, oldest first; most are known."""
        head = self._head
        found = news(entries, None if head is None else JournalHead(head.n, head.hash))
        if not found.entries:
            return
        if head is not None and not found.missing and found.entries[0]["n"] != head.n + 1:
            self.problem = self.problem or f"it was begun anew on the robot after entry {head.n}"
            self._head = None
            self.entries.clear()
        if found.missing:
            self.missing += found.missing
            self._head = None
        for entry in found.entries:
            self._append(entry)
        self.revision += 1

    def unbroken(self) -> Iterator[Entry]:
        """Yield the newest entries that follow each other without a hole."""
        entries = list(self.entries)
        first = len(entries) - 1
        while first > 0 and entries[first - 1]["n"] == entries[first]["n"] - 1:
            first -= 1
        return iter(entries[max(first, 0) :])

    @property
    def verdict(self) -> str:
        """In words, how far the journal can be believed."""
        if not self.entries:
            return (
                "No entry of the robot's journal has come yet: none was written, or it is still being read."
            )
        if self.problem is not None:
            return f"The journal is NOT INTACT: {self.problem}"
        span = f"Entries {self.entries[0]['n']} to {self.entries[-1]['n']}"
        if self.missing:
            return f"{span} are unaltered; {self.missing} between them came too fast to be seen here."
        return f"{span} are unaltered and in their places: the chain of hashes holds."

    def _append(self, entry: Entry) -> None:
        previous = None if self._head is None else self._head.hash
        self._head = Head(entry["n"], entry["hash"])
        self.entries.append(entry)
        try:
            check(entry["n"], previous, msgspec.json.encode(entry))
        except (Broken, KeyError) as error:
            self.problem = self.problem or (str(error) if isinstance(error, Broken) else f"no {error}")
