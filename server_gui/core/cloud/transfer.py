"""A whole store copied to another URL, object by object: with its versions, pins and transaction numbers.

Objects of a store are never altered, so a copy that was interrupted, or is older, is completed by what it
lacks. The log goes last, entry after entry: it never names a file that is not there.
"""

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

from ml.store import durable
from ml.store.compaction_lock import PLACE
from ml.store.errors import StoreError
from ml.store.objects import PIECE_BYTES, Object, Objects
from ml.store.private import opener, private_folder
from ml.store.probe import probe
from ml.store.store import ABOUT, Store
from ml.store.translation import translated
from server_gui.core.cloud.checksums import Altered, Digest, proven

Advance = Callable[[int], object]
PART: Final = ".part"
_LOG: Final = f"/{durable.LOG}/"
# What is no part of a store, and the one object that changes: a hint, which the next checkpoint makes anew.
_NOT_COPIED: Final = re.compile(rf"_probe/.*|{PLACE}/.*|.*{re.escape(PART)}|.*{_LOG}_last_checkpoint")
_ENTRY: Final = re.compile(rf"(.*){_LOG}(\d{{20}})\.json")
_NAMED: Final = ("models/", "pins/")  # what has a name that says nothing of its contents
_NO_NAMES: Final = ("", ".", "..")
TOLD: Final = 5  # names of what is in the way
Listing = Mapping[str, Object]


@dataclass(frozen=True, slots=True)
class Copied:
    """Result of a copy: the objects checked by MD5, and those checked by size alone."""

    by_checksum: int = 0
    by_size: int = 0
    size_bytes: int = 0

    def __add__(self, other: "Copied") -> "Copied":
        return Copied(
            self.by_checksum + other.by_checksum,
            self.by_size + other.by_size,
            self.size_bytes + other.size_bytes,
        )


def open_target(source: Store, url: str) -> Objects:
    """Open the place of a copy; raises `UnsafeStore` where several writers could not write to it."""
    target = Objects(url)
    if source.about.several_writers and not url.startswith("file://") and target.read(ABOUT) is None:
        probe(target)
    return target


def missing(source: Objects, target: Objects) -> list[Object]:
    """Return the objects that the target lacks, in the order in which they are to be copied.

    Raises:
        StoreError: the target is no earlier state of the source, has another model, pointer to one or pin
            by the same name, or an object has no place in a folder.

    """
    before = _listing(source)
    now = _listing(source)  # files are written before the log names them: all that `before` names are here
    wanted = {path: found for path, found in now.items() if path in before or _LOG not in path}
    if target.url.startswith("file://"):
        for path in wanted:
            beneath(_folder(target), path)
    there = _listing(target)
    _check(source, target, now, there)
    _check_named(source, target, wanted, there)
    return sorted((found for path, found in wanted.items() if _differs(found, there.get(path))), key=_order)


def copy(source: Objects, target: Objects, wanted: Sequence[Object], advance: Advance) -> Copied:
    """Copy these objects one after another; `advance` hears of bytes. Interrupted, it is called again.

    Raises:
        StoreError: one could not be copied, was altered on its way, or the target is written to meanwhile.

    """
    done = Copied()
    for found in wanted:
        try:
            by_checksum = _copy(source, target, found, advance)
        except Altered:
            target.remove(found.path)
            raise
        done += Copied(int(by_checksum), int(not by_checksum), found.size_bytes)
    return done


def _copy(source: Objects, target: Objects, found: Object, advance: Advance) -> bool:
    digest = Digest()
    if target.url.startswith("file://"):
        file = beneath(_folder(target), found.path)
        with translated(f"{file} cannot be written"):
            _into(file, source, found, digest, advance)
        if source.url.startswith("file://"):  # which makes no tags: what was written is read
            return proven(target, found, digest, ours=True)
        return proven(source, found, digest, ours=False)
    pieces = _told(digest.of(source.pieces(found)), advance)
    if _ENTRY.fullmatch(found.path):
        if not target.create(found.path, b"".join(pieces)):
            raise StoreError(f"{target.url} is written to by others: copy to a place of its own")
        return proven(target, replace(found, tag=""), digest, ours=True)
    return proven(target, replace(found, tag=target.write(found.path, pieces)), digest, ours=True)


def _into(file: Path, source: Objects, found: Object, digest: Digest, advance: Advance) -> None:
    """Into a folder, going on where an earlier attempt ended."""
    private_folder(file.parent)
    part = file.with_name(f"{file.name}{PART}")
    with open(part, "ab+", opener=opener) as out:
        out.truncate(min(out.tell(), found.size_bytes) // PIECE_BYTES * PIECE_BYTES)
        out.seek(0)
        for _ in _told(digest.of(iter(lambda: out.read(PIECE_BYTES), b"")), advance):
            pass
        for piece in _told(digest.of(source.pieces(found, out.tell())), advance):
            out.write(piece)
        out.flush()
        os.fsync(out.fileno())
    part.replace(file)


def _folder(target: Objects) -> Path:
    return Path(unquote(urlsplit(target.url).path))


def beneath(folder: Path, key: str) -> Path:
    """Return where an object goes in a folder, whatever whoever wrote to the store has called it.

    Raises:
        StoreError: that would be no file beneath the folder.

    """
    named = key.isprintable() and "\\" not in key and all(part not in _NO_NAMES for part in key.split("/"))
    file = folder / key
    if not named or not file.resolve().is_relative_to(folder.resolve()):
        raise StoreError(
            f"the store has an object that is called {key!r:.200}, which is no file beneath {folder}; "
            "see who writes to the store, and remove it there"
        )
    return file


def _told(pieces: Iterator[bytes], advance: Advance) -> Iterator[bytes]:
    for piece in pieces:
        yield piece
        advance(len(piece))


def _listing(objects: Objects) -> Listing:
    return {found.path: found for found in objects.listing() if not _NOT_COPIED.fullmatch(found.path)}


def _differs(found: Object, there: Object | None) -> bool:
    return there is None or there.size_bytes != found.size_bytes


def _order(found: Object) -> tuple[int, str]:
    """Files first, then logs, and last what says that there is a store."""
    return (2 if "/" not in found.path else int(_LOG in found.path), found.path)


def _check(source: Objects, target: Objects, ours: Listing, theirs: Listing) -> None:
    """Check that the newest entry of each of the target's logs is the source's too."""
    newest = {found[1]: path for path in sorted(theirs) if (found := _ENTRY.fullmatch(path))}
    for table, path in newest.items():
        if path not in ours or source.read(path) != target.read(path):
            raise StoreError(
                f"{target.url}/{table} is no earlier state of {source.url}/{table}: something else was "
                "written there. Copy to a place where nothing is yet"
            )


def _check_named(source: Objects, target: Objects, ours: Listing, theirs: Listing) -> None:
    """Models, what says which serves, and pins: both have the same where both have one."""
    both = sorted(path for path in ours.keys() & theirs.keys() if path.startswith(_NAMED))
    wrong = [path for path in both if source.read(path) != target.read(path)]
    if wrong:
        more = f" and {len(wrong) - TOLD} more" if len(wrong) > TOLD else ""
        raise StoreError(
            f"{target.url} has other contents than {source.url} in {', '.join(wrong[:TOLD])}{more}: nothing "
            "was copied. Copy to a place where nothing is yet"
        )
