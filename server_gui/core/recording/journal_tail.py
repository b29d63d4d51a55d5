"""New entries in the tail of a robot's journal, which is read again and again."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from server_gui.core.recording.rows import JournalHead

Entry = dict[str, Any]


@dataclass(frozen=True, slots=True)
class NewEntries:
    """Entries that follow the head; `missing` were written in between and can no longer be seen."""

    entries: Sequence[Entry]
    missing: int


def news(entries: Sequence[Entry], head: JournalHead | None) -> NewEntries:
    """Return the entries of a tail (oldest first) after `head`.

    A journal that does not hold the head, though it should, has been begun anew: then all of it is news.
    """
    if head is None or not entries:
        return NewEntries(entries, 0)
    first = entries[0]["n"]
    if first > head.n:
        return NewEntries(entries, first - head.n - 1)
    later = [entry for entry in entries if entry["n"] > head.n]
    same = any(entry["n"] == head.n and entry["hash"] == head.hash for entry in entries)
    return NewEntries(later if same else entries, 0)
