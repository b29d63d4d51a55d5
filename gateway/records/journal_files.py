"""A journal's files: the one that is written to, and older pieces beside it, each named by its last line.

`journal.jsonl` is the newest piece, `journal.jsonl.000000000500` one that ends with line 500. Whoever reads
opens them for itself and holds nobody.
"""

import contextlib
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import msgspec

from gateway.records.chain import UNDECODABLE, Broken, Head, check

Entry = dict[str, Any]

TAIL_BYTES: Final = 1024 * 1024  # of entries in one answer
LINE_BYTES: Final = 16 * 1024 * 1024  # no line that was written is as long
_STEP: Final = 64 * 1024
_NUMBER: Final = re.compile(r"[0-9]{12,}")


class ClosedJournalFile(NamedTuple):
    """A file to which nothing is added any more."""

    last: int  # the number of its last line
    path: Path


class Tail(NamedTuple):
    """The newest entries, oldest first; `cut` says why there are fewer than were asked for and are there."""

    entries: list[Entry]
    cut: str | None = None


def head_file(journal: Path) -> Path:
    """Return the file that keeps the newest hash of a journal."""
    return journal.with_name(f"{journal.name}.head")


def read_head(journal: Path) -> Head | None:
    """Return the recorded head of the journal; `None` if none was written.

    Raises:
        Broken: the head's file is damaged.

    """
    try:
        return msgspec.json.decode(head_file(journal).read_bytes(), type=Head)
    except FileNotFoundError:
        return None
    except UNDECODABLE as error:
        raise Broken(f"{head_file(journal).name} is damaged: {error}") from error


def closed_piece(journal: Path, last: int) -> ClosedJournalFile:
    """Return the name of a piece that ends with this line."""
    return ClosedJournalFile(last, journal.with_name(f"{journal.name}.{last:012}"))


def closed_pieces(journal: Path) -> list[ClosedJournalFile]:
    """Return those that are there, oldest first."""
    try:
        paths = list(journal.parent.iterdir())
    except FileNotFoundError:
        return []
    names = ((path, path.name.removeprefix(f"{journal.name}.")) for path in paths)
    return sorted(ClosedJournalFile(int(name), path) for path, name in names if _NUMBER.fullmatch(name))


def newest_line(journal: Path) -> bytes | None:
    """Return the last whole line of all pieces, without its end."""
    return next(_newest_first(journal), None)


def tail(journal: Path, count: int, newest: int) -> Tail:
    """Return the newest entries up to the number `newest`, in time and memory linear in what is given.

    Raises:
        Broken: what is there is no journal.
        OSError: it cannot be read.

    """
    entries: list[Entry] = []
    left = TAIL_BYTES
    for line in _newest_first(journal):
        entry = decoded(line)
        if entry["n"] > newest:  # it is being written, and not durable yet
            continue
        left -= len(line)
        if entries and left < 0:
            said = f"these {len(entries)} of {count} fill the {TAIL_BYTES} bytes of an answer"
            return Tail(entries[::-1], said)
        entries.append(entry)
        if len(entries) == count:
            break
    return Tail(entries[::-1])


def decoded(line: bytes) -> Entry:
    """Return an entry with its number; raises `Broken`."""
    try:
        entry = msgspec.json.decode(line, type=Entry)
    except UNDECODABLE as error:
        raise Broken(str(error)) from error
    if not isinstance(entry.get("n"), int):
        raise Broken("an entry has no number")
    return entry


def hash_of(line: bytes) -> Head:
    """Return the hash of a line, to which the next one refers; raises `Broken`."""
    return check(0, None, line)[0]


def end_of_last_line(file: BinaryIO) -> int:
    """Behind its newline; what comes then is half a line."""
    end = file.seek(0, os.SEEK_END)
    while end:
        begin = max(0, end - _STEP)
        file.seek(begin)
        found = file.read(end - begin).rfind(b"\n")
        if found >= 0:
            return begin + found + 1
        end = begin
    return 0


def lines_backwards(file: BinaryIO) -> Iterator[bytes]:
    """Whole lines without their ends, the last one first; reads what is taken, and everything once.

    Raises:
        Broken: one is longer than any that was written.

    """
    end = end_of_last_line(file) - 1
    parts: list[bytes] = []  # of the line whose beginning was not read yet, its end first
    while end > 0:
        begin = max(0, end - _STEP)
        file.seek(begin)
        first, *others = file.read(end - begin).split(b"\n")
        while others:
            parts.append(others.pop())
            yield b"".join(reversed(parts))
            parts.clear()
        parts.append(first)
        end = begin
        if len(parts) * _STEP > LINE_BYTES:
            raise Broken(f"a line has more than {LINE_BYTES} bytes")
    if end == 0:
        yield b"".join(reversed(parts))


def _newest_first(journal: Path) -> Iterator[bytes]:
    """Yield lines of all pieces. Pieces may be closed and removed meanwhile: each line is given once."""
    oldest = None
    with contextlib.suppress(FileNotFoundError), journal.open("rb") as file:
        for oldest in lines_backwards(file):
            yield oldest
    first = None if oldest is None else decoded(oldest)["n"]
    for piece in reversed(closed_pieces(journal)):
        if first is not None and piece.last >= first:  # it was the newest one a moment ago
            continue
        try:
            file = piece.path.open("rb")
        except FileNotFoundError:  # all before it are gone too
            return
        with file:
            yield from lines_backwards(file)
