"""What a power cut has torn off in the log of a table in a folder, and how it is set aside.

The table format's library writes entries and checkpoints without synchronising them, so after a power cut
the newest may be a beginning of itself. An entry that was synchronised before its batch was acknowledged has
a mark (durable.py): one that is torn and has none is worth nothing, and what it added is still in some spool.
Without it the table is as it was before. A checkpoint repeats what entries say. Either is renamed and kept.
"""

import contextlib
import fcntl
import itertools
import json
import logging
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pyarrow.lib
import pyarrow.parquet

from ml.store import durable
from ml.store.errors import StoreError

log = logging.getLogger(__name__)

SETTLED_S: Final = 10.0  # so long nobody has touched what is set aside: it is not just being written
ASIDE: Final = ".torn"
_HINT: Final = "_last_checkpoint"
_ENTRIES: Final = "[0-9]" * 20 + ".json"
_CHECKPOINTS: Final = "[0-9]" * 20 + ".checkpoint.parquet"
_COUNTED: Final = {  # operations that lose rows, or double them, where some of their lines are missing
    "OPTIMIZE": {"add": "numFilesAdded", "remove": "numFilesRemoved"},
    "DELETE": {"add": "num_added_files", "remove": "num_removed_files"},
}


@dataclass(frozen=True, slots=True)
class Torn:
    """A file of the log that is not whole; `spare` where the table is whole without it."""

    file: Path
    spare: bool

    def __str__(self) -> str:
        if self.spare:
            return (
                f"{self.file} is cut off, as by a power cut, and was never acknowledged: the next upload, or "
                "gwrms cloud compact, sets it aside, and what it was to add is uploaded again"
            )
        return (
            f"{self.file} is damaged, and was whole once: bring this file back from a copy of the store; "
            "what it says of the table is nowhere else"
        )


def find(table: Path) -> Torn | None:
    """What keeps the table from being read, or makes what is read wrong."""
    return next(itertools.chain(_entry(table), _checkpoint(table), _earlier(table)), None)


def set_aside(table: Path) -> list[Path]:
    """Set aside what is torn off at the log's end; new names of the files. To be done before writing.

    Raises:
        StoreError: it may just be written, or is no power cut's doing.

    """
    found: list[Path] = []
    if not (table / durable.LOG).is_dir():
        return found
    with _locked(table / durable.LOG):
        while (torn := next(itertools.chain(_entry(table), _checkpoint(table)), None)) is not None:
            if not torn.spare:
                raise StoreError(str(torn))
            if abs(time.time() - torn.file.stat().st_mtime) < SETTLED_S:
                raise StoreError(f"{torn.file} is being written, or is cut off: try again in {SETTLED_S:g} s")
            found.append(_renamed(torn.file))
    return found


def whole(entry: bytes) -> bool:
    """Whether an entry has all of its lines, as far as it says itself how many there are."""
    try:
        actions: list[dict[str, Any]] = [json.loads(line) for line in entry.splitlines()]
    except ValueError:
        return False
    if not actions:
        return False
    kinds = [kind for action in actions for kind in action]
    info = actions[0].get("commitInfo", {})
    operation, told = info.get("operation"), info.get("operationMetrics", {})
    if operation == "CREATE TABLE":
        return "metaData" in kinds
    if operation == "WRITE" and not told:  # one of ours, whose transaction is its last line
        return kinds[-1] == "txn"
    counted = _COUNTED.get(operation, {})
    return all(kinds.count(kind) == told[name] for kind, name in counted.items() if name in told)


def _entry(table: Path) -> Iterator[Torn]:
    """The newest one."""
    file = max((table / durable.LOG).glob(_ENTRIES), default=None)
    if file is not None and not whole(file.read_bytes()):
        yield Torn(file, spare=not durable.is_marked(file))


def _checkpoint(table: Path) -> Iterator[Torn]:
    """The newest one."""
    file = max((table / durable.LOG).glob(_CHECKPOINTS), default=None)
    if file is not None:
        try:
            pyarrow.parquet.read_metadata(file)
        except pyarrow.lib.ArrowException:
            yield Torn(file, spare=True)


def _earlier(table: Path) -> Iterator[Torn]:
    """Entries before the newest one, newest first, that nobody can read."""
    for file in sorted((table / durable.LOG).glob(_ENTRIES), reverse=True)[1:]:
        try:
            for line in file.read_bytes().splitlines():
                json.loads(line)
        except ValueError:
            yield Torn(file, spare=False)


def _renamed(file: Path) -> Path:
    places = (file.with_name(f"{file.name}{ASIDE}{number or ''}") for number in itertools.count())
    aside = next(place for place in places if not place.exists())
    if file.match(_CHECKPOINTS):
        file.with_name(_HINT).unlink(missing_ok=True)  # which may be of it
    file.rename(aside)
    durable.synchronise([aside])
    log.warning(
        "%s was cut off, as by a power cut, and is kept as %s; nothing of it was acknowledged",
        file,
        aside.name,
    )
    return aside


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Against others who do the same."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
