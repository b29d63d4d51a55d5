"""A journal's entries from first to last, each checked against the one before, over all its pieces."""

import contextlib
import itertools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final

import msgspec

from gateway.records.chain import UNDECODABLE, Broken, Head, verify
from gateway.records.journal_files import Entry, closed_pieces, read_head

SHORTENED: Final = "journal shortened"  # an entry that says which lines the journal itself has removed
_TRIES: Final = 10


def read_verified(journal: Path) -> list[Entry]:
    """Return every entry of a journal whose chain holds.

    Raises:
        Broken: it does not; the message says where.
        OSError: it cannot be read.

    """
    return list(verified(journal))


def verified(journal: Path) -> Iterator[Entry]:
    """Yield the same one by one.

    The first has not number 1 where the journal has removed what was before it.
    """
    head = read_head(journal)
    with contextlib.ExitStack() as opened:
        files = _open_all(journal, opened)
        if not files and head is not None and head.n:
            raise Broken(f"{journal} is missing: {head.n} entries were written", 1)
        if not files:
            raise FileNotFoundError(f"{journal} is not there")
        begin = _before(files[0])
        removed = Head()
        for entry in verify(itertools.chain.from_iterable(files), head, begin):
            removed = _removed(entry) or removed
            yield entry
        _check_removed(begin, removed)


def _open_all(journal: Path, opened: contextlib.ExitStack) -> list[BinaryIO]:
    """Return every piece, oldest first, as they are at one moment: a gateway may close one meanwhile."""
    for _ in range(_TRIES):
        pieces = closed_pieces(journal)
        with contextlib.ExitStack() as tried:
            files = [_open(path, tried) for path in (*(one.path for one in pieces), journal)]
            if closed_pieces(journal) == pieces:
                opened.push(tried.pop_all())
                return [file for file in files if file is not None]
    raise OSError(None, f"the pieces of {journal} change all the time; try again")


def _open(path: Path, opened: contextlib.ExitStack) -> BinaryIO | None:
    try:
        return opened.enter_context(path.open("rb"))
    except FileNotFoundError:
        return None


def _before(file: BinaryIO) -> Head:
    """Return the head to which the first line refers; it is verified together with all other lines."""
    first = next(iter(file), b"")
    file.seek(0)
    try:
        fields = msgspec.json.decode(first, type=dict[str, Any])
        return Head(max(0, fields["n"] - 1), str(fields["previous"])) if fields["n"] > 1 else Head()
    except (*UNDECODABLE, KeyError, TypeError):
        return Head()


def _removed(entry: Mapping[str, Any]) -> Head | None:
    """Return up to which line the journal says that it was shortened."""
    if entry.get("what") != SHORTENED:
        return None
    return Head(entry["up_to"], entry["up_to_hash"])


def _check_removed(begin: Head, removed: Head) -> None:
    """Check that missing entries at the beginning are those that the journal has removed."""
    if begin.n > removed.n:
        raise Broken(
            f"lines 1 to {begin.n} are missing, and the journal does not say that it removed them: "
            "put its older pieces (journal.jsonl.NUMBER) beside it",
            1,
        )
    if begin.n and begin.n == removed.n and begin.hash != removed.hash:
        text = f"line {begin.n + 1} does not follow the line that was removed before it"
        raise Broken(text, begin.n + 1)
