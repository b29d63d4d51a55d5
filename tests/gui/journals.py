"""A robot's journal, written by the gateway's own code and told over its wire, from memory."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from gateway.records.journal import Journal
from gateway.wire.messages import JournalEntries
from server_gui.core.follow.events import Journalled


class RobotsJournal:
    """Writes what a gateway would; `told` is what a window would be told of it."""

    def __init__(self, folder: Path, boot_id: str = "boot-1") -> None:
        self._journal = Journal(folder / "journal.jsonl", boot_id)
        self._writes = 0

    def close(self) -> None:
        self._journal.close()

    def say(self, what: str, who: str = "ada at 10.0.0.3", **details: Any) -> None:
        """One entry, durable."""
        self._journal.append(who, what, **details).result()

    def written(
        self,
        before: Mapping[str, float],
        after: Mapping[str, float],
        end: str = "write done",
        **details: Any,
    ) -> int:
        """A write with its end; its number."""
        self._writes += 1
        trial_s = 20.0 if end == "trial begun" else None
        self.say("write", write=self._writes, before=before, after=after, trial_s=trial_s)
        self.say(end, write=self._writes, **({"after": after} | details))
        return self._writes

    def told(self, count: int = 1000) -> Journalled:
        """The newest entries as they come over the wire."""
        line = msgspec.json.encode(JournalEntries(*self._journal.tail(count).result()))
        return Journalled(msgspec.json.decode(line, type=JournalEntries))
