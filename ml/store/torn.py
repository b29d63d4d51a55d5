"""Log entries torn by a power cut in a folder's table, and their removal.

The table format's library writes entries, checkpoints and the hint at the newest of these without
synchronising them, so after a power cut any of them may be missing, or a beginning of itself. An entry that
was synchronised before its batch was acknowledged has a mark (durable.py). After the newest mark the log is
worth nothing from the first torn entry on; what it added is still in some spool, and without it the table is
as it was before. A checkpoint repeats what entries say. Whatever is torn is renamed and kept.
"""

import itertools
import json
import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote

import pyarrow.lib
import pyarrow.parquet

from ml.store import durable
from ml.store.errors import StoreError

log = logging.getLogger(__name__)

SETTLED_S: Final = 10.0  # so long nobody has touched what is set aside: it is not just being written
ASIDE: Final = ".torn"
HINT: Final = "_last_checkpoint"
_ENTRIES: Final = "[0-9]" * 20 + ".json"
_CHECKPOINTS: Final = "[0-9]" * 20 + ".checkpoint*.parquet"
_UNREADABLE: Final = (pyarrow.lib.ArrowException, OSError)  # what pyarrow raises, of whatever bytes
_COUNTED: Final = {  # operations that lose rows, or double them, where some of their lines are missing
    "OPTIMIZE": {"add": "numFilesAdded", "remove": "numFilesRemoved"},
    "DELETE": {"add": "num_added_files", "remove": "num_removed_files"},
}


@dataclass(frozen=True, slots=True)
class Torn:
    """A file of the log that is not whole; `spare` where the table is whole without it and all after it."""

    file: Path
    spare: bool

    def __str__(self) -> str:
        if self.spare:
            return (
                f"{self.file} is cut off, as by a power cut, and was never acknowledged: the next upload, or "
                "gwrms cloud compact, sets it aside, and what it was to add is uploaded again"
            )
        how = "damaged" if self.file.exists() else "missing"
        return (
            f"{self.file} is {how}, and was whole once: bring this file back from a copy of the store; "
            "what it says of the table is nowhere else"
        )


def find(table: Path) -> Torn | None:
    """Return the torn part that makes the table unreadable, or wrong."""
    return next(
        itertools.chain(*(look(table) for look in (_end, _checkpoint, _hint, _earlier, _beginning))), None
    )


def set_aside(table: Path) -> list[Path]:
    """Set aside what is torn off at the log's end; new names of the files. To be done before writing.

    Raises:
        StoreError: it may just be written, or is no power cut's doing.

    """
    found: list[Path] = []
    if not (table / durable.LOG).is_dir():
        return found
    with durable.undisturbed(table) as is_still:
        looks = (_end, _checkpoint, _hint, *([_unread, _unsure] if is_still else []))
        while (torn := next((torn for look in looks for torn in look(table)), None)) is not None:
            if not torn.spare:
                raise StoreError(str(torn))
            if not (is_still and _is_settled(torn.file)):
                raise StoreError(f"{torn.file} is being written, or is cut off: try again in {SETTLED_S:g} s")
            found += map(_renamed, _with_later(torn.file))
    return found


def whole(entry: bytes) -> bool:
    """Return whether an entry has all of its lines, as far as it says itself how many there are."""
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


def newest(table: Path) -> int:
    """Return the newest version that has an entry; -1 without any."""
    return max(map(_version, _entries(table)), default=-1)


# --- looks


def _end(table: Path) -> Iterator[Torn]:
    """Yield the log's worthless end: from an entry that is cut off, or whose predecessor is missing."""
    lasting, later = _ends(table)
    before = lasting[-1:]
    for file in later:
        if not whole(file.read_bytes()) or (_is_gap(before, file) and _may_go(lasting, file)):
            yield Torn(file, spare=True)
        before = [file]
    if lasting and not later and not whole(lasting[-1].read_bytes()):
        yield Torn(lasting[-1], spare=False)


def _unread(table: Path) -> Iterator[Torn]:
    """Yield newest entries with unreadable files: these may be named before they are durable.

    Those that they were made of are still there.
    """
    lasting, later = _ends(table)
    if not _is_marked(lasting):
        return
    actions = {file: list(durable.read(file)) for file in later}
    gone = {each["remove"]["path"] for said in actions.values() for each in said if "remove" in each}
    for file, said in actions.items():
        added = (each["add"] for each in said if "add" in each and each["add"]["path"] not in gone)
        if not all(_is_whole(table, add) for add in added):
            yield Torn(file, spare=True)


def _checkpoint(table: Path) -> Iterator[Torn]:
    """Yield the newest one: where it is cut off, or of a version that the log does not have (any more)."""
    file = max((table / durable.LOG).glob(_CHECKPOINTS), default=None)
    if file is not None:
        try:
            pyarrow.parquet.read_table(file)
        except _UNREADABLE:
            yield Torn(file, spare=True)
        else:
            if _version(file) > newest(table) >= 0:
                yield Torn(file, spare=True)


def _unsure(table: Path) -> Iterator[Torn]:
    """Yield the newest checkpoint, if it may not be durable and the log has its content."""
    file = max((table / durable.LOG).glob(_CHECKPOINTS), default=None)
    lasting, _ = _ends(table)
    if file is None or durable.is_marked(file) or not _is_marked(lasting):
        return
    if _version(lasting[0]) == 0:
        yield Torn(file, spare=True)


def _hint(table: Path) -> Iterator[Torn]:
    """Yield a hint to the newest checkpoint that is missing or unreadable."""
    hint = table / durable.LOG / HINT
    if hint.exists():
        try:
            named = json.loads(hint.read_bytes())["version"]
        except (ValueError, LookupError, TypeError):
            named = -1
        if not any(_version(file) == named for file in hint.parent.glob(_CHECKPOINTS)):
            yield Torn(hint, spare=True)


def _earlier(table: Path) -> Iterator[Torn]:
    """Entries before the newest one, newest first, that nobody can read."""
    for before, file in itertools.pairwise(reversed(_entries(table))):
        if _is_gap([file], before):
            yield Torn(durable.log_entry(table, _version(file) + 1), spare=False)
        try:
            list(durable.read(file))
        except ValueError:
            yield Torn(file, spare=False)


def _beginning(table: Path) -> Iterator[Torn]:
    """Yield the entry missing before the oldest one, if no checkpoint stands for it."""
    oldest = min(map(_version, _entries(table)), default=0)
    checkpoints = (table / durable.LOG).glob(_CHECKPOINTS)
    if oldest and not any(_version(file) >= oldest - 1 for file in checkpoints):
        yield Torn(durable.log_entry(table, oldest - 1), spare=False)


# --- inside


def _ends(table: Path) -> tuple[list[Path], list[Path]]:
    """Return the log up to the newest mark, and what comes after it.

    Without a mark anywhere the newest entry may be no power cut's loss, nor what it does not build on.
    """
    entries = _entries(table)
    at = len(entries)
    while at and not durable.is_marked(entries[at - 1]):
        at -= 1
    if entries and not at:
        at = len(entries) - 1
        while at and _changes_nothing(entries[at]):
            at -= 1
    return entries[:at], entries[at:]


def _entries(table: Path) -> list[Path]:
    return sorted((table / durable.LOG).glob(_ENTRIES))


def _version(file: Path) -> int:
    """Return the version of an entry or a checkpoint, by its name."""
    return int(file.name[:20])


def _is_settled(file: Path) -> bool:
    """Return whether it is not being written now; a hint comes after what it names, and needs it."""
    return file.name == HINT or abs(time.time() - file.stat().st_mtime) >= SETTLED_S


def _is_gap(before: Sequence[Path], file: Path) -> bool:
    return bool(before) and _version(file) > _version(before[-1]) + 1


def _is_marked(lasting: Sequence[Path]) -> bool:
    return bool(lasting) and durable.is_marked(lasting[-1])


def _may_go(lasting: Sequence[Path], file: Path) -> bool:
    """Return whether a whole entry was surely never acknowledged, or nobody misses it."""
    return _is_marked(lasting) or _changes_nothing(file)


def _changes_nothing(entry: Path) -> bool:
    """As those of a vacuum."""
    try:
        return all(action.keys() == {"commitInfo"} for action in durable.read(entry))
    except ValueError:
        return False


def _is_whole(table: Path, add: Mapping[str, Any]) -> bool:
    """Return whether a file is readable to its end, with the size and the rows that the log says."""
    file = table / unquote(add["path"])
    try:
        if file.stat().st_size != add["size"]:
            return False
        rows = sum(batch.num_rows for batch in pyarrow.parquet.ParquetFile(file).iter_batches())
    except _UNREADABLE:
        return False
    return bool(rows == json.loads(add.get("stats") or "{}").get("numRecords", rows))


def _with_later(file: Path) -> list[Path]:
    """Newest first, so that the log is one at any moment."""
    if not file.match(_ENTRIES):
        return [file]
    return sorted((each for each in file.parent.glob(_ENTRIES) if each.name >= file.name), reverse=True)


def _renamed(file: Path) -> Path:
    places = (file.with_name(f"{file.name}{ASIDE}{number or ''}") for number in itertools.count())
    aside = next(place for place in places if not place.exists())
    file.rename(aside)
    durable.synchronise([aside])
    log.warning(
        "%s was cut off, as by a power cut, and is kept as %s; nothing of it was acknowledged",
        file,
        aside.name,
    )
    return aside
