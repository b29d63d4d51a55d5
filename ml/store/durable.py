"""Commits in a folder, made to last: the table format's library never synchronises what it writes.

An entry of the log that was synchronised has an attribute that says so. Nothing makes that attribute last:
after a power cut it may be missing from an entry that did last, but it is on none that did not.
"""

import contextlib
import json
import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final
from urllib.parse import unquote

LOG: Final = "_delta_log"
_MARK: Final = "user.gwrms.lasts"
_LEVELS: Final = 5  # of folders, from a file in a partition up to the store's own
_AT_ONCE: Final = 8  # so that the disk can take several in one go


def make_last(table: Path, writer: str, sequence: int) -> None:
    """Synchronise the files of the commit that holds this transaction, its log entry and their folders."""
    entry = _commit(table, writer, sequence)
    if entry is None:  # the log was cleaned since: everything is old, or we cannot tell
        os.sync()
        return
    actions = map(json.loads, entry.read_text().splitlines())
    files = [table / unquote(action["add"]["path"]) for action in actions if "add" in action]
    synchronise([*files, entry])


def synchronise(files: Iterable[Path]) -> None:
    """Make these files and their names last, up to the folder above the table's."""
    found = [file for file in files if file.exists()]  # what was compacted since is in another commit
    folders = {folder for file in found for folder in list(file.parents)[:_LEVELS]}
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        list(pool.map(_sync, found))
        list(pool.map(_sync, folders))
    for file in found:
        if file.parent.name == LOG and file.suffix == ".json":
            with contextlib.suppress(OSError):  # not every file system has attributes
                os.setxattr(file, _MARK, b"1")


def is_marked(entry: Path) -> bool:
    """Whether this entry is known to have been synchronised, and so may have been acknowledged."""
    try:
        return os.getxattr(entry, _MARK) == b"1"
    except OSError:
        return False


def _commit(table: Path, writer: str, sequence: int) -> Path | None:
    """The log entry that holds the transaction, looked for from the newest back."""
    for entry in sorted((table / LOG).glob("*.json"), reverse=True):
        for action in map(json.loads, entry.read_text().splitlines()):
            known = action.get("txn")
            if known is not None and known["appId"] == writer:
                return entry if known["version"] == sequence else None
    return None


def _sync(path: Path) -> None:
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except FileNotFoundError:  # it has gone since: what needs it no more was made to last before
        return
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
