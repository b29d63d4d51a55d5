"""Commits in a folder, made to last: the table format's library never synchronises what it writes.

An entry of the log has an attribute where it and all before it were synchronised, with their files; so has a
checkpoint. Nothing makes that attribute last: after a power cut it may be missing from what did last, but it
is on nothing that did not.
"""

import contextlib
import json
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote

from ml.store import locks
from ml.store.private import opener, private_folder

LOG: Final = "_delta_log"
_MARK: Final = "user.gwrms.lasts"
_HAS_MARKS: Final = hasattr(os, "setxattr")  # without them, as on macOS, nobody knows what lasts
_LEVELS: Final = 5  # of folders, from a file in a partition up to the store's own
_AT_ONCE: Final = 8  # so that the disk can take several in one go


def make_last(table: Path, newest: int, known: int = -1) -> None:
    """Synchronise the log up to this version, with all files that it names; up to `known` that was done.

    Also what others have committed: what is built on it is worth nothing without it.
    """
    entries = list(_open(table, newest, known))
    actions = (action for entry in entries for action in read(entry))
    files = [table / unquote(action["add"]["path"]) for action in actions if "add" in action]
    synchronise([*files, *entries])
    mark(entries)


def synchronise(files: Iterable[Path]) -> None:
    """Make these files and their names last, up to the folder above the table's."""
    found = [file for file in files if file.exists()]  # what was compacted since is in another commit
    folders = {folder for file in found for folder in list(file.parents)[:_LEVELS]}
    if len(found) < _AT_ONCE:  # threads would cost more than they gain
        for file in found:
            _sync(file)
    else:
        with ThreadPoolExecutor(_AT_ONCE) as pool:
            list(pool.map(_sync, found))
    for folder in folders:
        _sync_names(folder)


def sync(path: Path) -> None:
    """Make a file's contents, or the names in a folder, last; raises `OSError`."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def create(file: Path, data: bytes) -> bool:
    """Write a file that is not there yet, whole or not at all; False where it is. Either way it lasts."""
    private_folder(file.parent)
    number = int.from_bytes(os.urandom(6))
    draft = file.with_name(f"{file.name}#{number}")  # as the library's own drafts, which no listing shows
    try:
        with open(draft, "xb", opener=opener) as out:
            out.write(data)
            out.flush()
            os.fsync(out.fileno())
        with contextlib.suppress(FileExistsError):
            file.hardlink_to(draft)
            return True
        return False
    finally:
        draft.unlink(missing_ok=True)
        synchronise([file])


@contextlib.contextmanager
def unfinished(table: Path) -> Iterator[None]:
    """Keep others within the block from setting aside commits of ours that may not last yet."""
    with locks.of_folder(table / LOG, shared=True):
        yield


@contextlib.contextmanager
def undisturbed(table: Path) -> Iterator[bool]:
    """Keep everybody's commits away within the block; False where somebody has some that do not last yet."""
    try:
        with locks.of_folder(table / LOG):
            yield True
    except BlockingIOError:
        yield False


def mark(synchronised: Iterable[Path]) -> None:
    """Say of entries or checkpoints that they last."""
    for file in synchronised if _HAS_MARKS else ():
        with contextlib.suppress(OSError):  # not every file system has attributes
            os.setxattr(file, _MARK, b"1")


def is_marked(file: Path) -> bool:
    """Return whether this is known to be synchronised; an entry may be acknowledged then."""
    try:
        return _HAS_MARKS and os.getxattr(file, _MARK) == b"1"
    except OSError:
        return False


def log_entry(table: Path, version: int) -> Path:
    """Return the log entry of this version."""
    return table / LOG / f"{version:020}.json"


def read(entry: Path) -> Iterator[dict[str, Any]]:
    """Yield the entry's actions, line by line."""
    yield from map(json.loads, entry.read_bytes().splitlines())


def _open(table: Path, newest: int, known: int) -> Iterator[Path]:
    """Yield from the newest entry back, as far as nobody knows that they last."""
    for version in range(newest, known, -1):
        file = log_entry(table, version)
        if not file.exists() or is_marked(file):  # not there: the log was cleaned below
            return
        yield file


def _sync_names(folder: Path) -> None:
    with contextlib.suppress(PermissionError):  # another's, which was there before
        _sync(folder)


def _sync(path: Path) -> None:
    with contextlib.suppress(FileNotFoundError):  # what needs it no more was made to last before it went
        sync(path)
