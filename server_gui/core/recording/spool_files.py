"""A spool's folder: who has it, and what its files are called and tell.

`00000007.db` is a segment; the highest number is written, all others are frozen, and a segment's number is
the batch's sequence number at the store, for ever. `00000006.uploaded.db` is in the store and goes when room
is needed. `00000005.damaged.db` cannot be read, or runs of it cannot: these are not in the store, and it
stays for somebody to look at. The highest number is never removed, so that no number is given twice; should
somebody have removed files, what is written from then on goes to the store under another `writer` anyway.
`00000004.cut.db` is a copy of a segment whose log was damaged, as it was found: commits at its end are lost.
`00000003.lost` is what the loss of a whole batch is called at the store, by whichever opening it is told.
`receipts.jsonl` says what of each segment is in the store (receipts.py).
"""

import contextlib
import logging
import os
import re
import shutil
import sqlite3
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import IO, Final

from ml.store import durable, locks
from ml.store.private import closed_folder, opener
from server_gui.core.recording.errors import Damaged, SpoolUnusable
from server_gui.core.recording.segment import PAGE_BYTES, SUFFIXES, Segment
from server_gui.core.recording.wal import lost_commits

log = logging.getLogger(__name__)

_ID: Final = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_LOSS: Final = re.compile(rf"{_ID.pattern}/[0-9]{{16}}-[0-9a-f]{{12}}/lost")
_NAME: Final = re.compile(r"(\d{8})(\.uploaded|\.damaged|\.cut)?\.db")


class SegmentState(Enum):
    """State of a segment, by its file's name."""

    WAITING = ""
    UPLOADED = ".uploaded"
    DAMAGED = ".damaged"
    CUT = ".cut"  # not the segment itself, but a copy for somebody to look at


class Files:
    """The files of the spool in this folder, as they are now."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, number: int, kept: SegmentState = SegmentState.WAITING) -> Path:
        """Return where a segment is, or would be."""
        return self.folder / f"{number:08}{kept.value}.db"

    def rename(self, number: int, kept: SegmentState) -> None:
        """Call a segment that has waited by another name, with its log, which a reader may keep open."""
        with writing(self.folder):
            for suffix in SUFFIXES:
                file = self.path(number).with_name(self.path(number).name + suffix)
                if file.exists():
                    file.rename(file.with_name(self.path(number, kept).name + suffix))
            durable.sync(self.folder)

    def finish_names(self) -> None:
        """Complete an interrupted renaming of a segment."""
        for number, kept in self.own():
            file = self.path(number)
            left = file.with_name(f"{file.name}-wal").exists() and not file.exists()
            if left and kept is not SegmentState.WAITING:
                self.rename(number, kept)

    def segments(self) -> list[tuple[int, SegmentState]]:
        """Return their numbers, in order, and what has become of them; raises `SpoolUnusable`."""
        try:
            names = [_NAME.fullmatch(path.name) for path in self.folder.iterdir()]
        except OSError as error:
            reason = error.strerror or error
            raise SpoolUnusable(f"the spool {self.folder} cannot be read: {reason}") from error
        found = [(int(name[1]), SegmentState(name[2] or "")) for name in names if name]
        return sorted(found, key=lambda each: (each[0], each[1].value))

    def own(self) -> list[tuple[int, SegmentState]]:
        """Return the segments themselves, without copies."""
        return [(number, kept) for number, kept in self.segments() if kept is not SegmentState.CUT]

    def all_of(self, wanted: SegmentState) -> list[int]:
        """Return the numbers of those of which this has become."""
        return [number for number, kept in self.segments() if kept is wanted]

    def identify(self, name: str) -> None:
        """Write down what this spool is called at the store."""
        self._write("id", name)

    def name_loss(self, number: int, name: str) -> str:
        """Return the name of this batch's loss at the store; `name` if it has none yet."""
        file = self.folder / f"{number:08}.lost"
        known = file.read_bytes().decode(errors="replace").strip() if file.exists() else ""
        if not _LOSS.fullmatch(known):
            self._write(file.name, name)
            return name
        return known

    def _write(self, name: str, text: str) -> None:
        file = self.folder / name
        draft = file.with_name(f"{name}.draft")
        with open(draft, "w", opener=opener) as out:
            out.write(f"{text}\n")
            out.flush()
            os.fsync(out.fileno())
        draft.rename(file)
        durable.sync(self.folder)

    def keep_damaged_logs(self) -> None:
        """Keep damaged logs before SQLite reads them up to the damage and forgets the rest."""
        for number in self.all_of(SegmentState.WAITING):
            log_ = self.path(number).with_name(f"{self.path(number).name}-wal")
            if lost_commits(log_, PAGE_BYTES) and number not in self.all_of(SegmentState.CUT):
                self._copy(number)
        for number in sorted(set(self.all_of(SegmentState.CUT)) & set(self.all_of(SegmentState.WAITING))):
            self._cut(number)

    def _copy(self, number: int) -> None:
        """Copy the database last: its presence proves a complete copy."""
        for suffix in reversed(SUFFIXES):
            source = self.path(number).with_name(self.path(number).name + suffix)
            if not source.exists():  # the log's index; SQLite makes it anew
                continue
            target = self.path(number, SegmentState.CUT).with_name(
                self.path(number, SegmentState.CUT).name + suffix
            )
            draft = target.with_name(f"{target.name}.draft")
            with source.open("rb") as content, open(draft, "wb", opener=opener) as out:
                shutil.copyfileobj(content, out)
                out.flush()
                os.fsync(out.fileno())
            draft.rename(target)
        durable.sync(self.folder)

    def _cut(self, number: int) -> None:
        """Let the segment itself tell what it has lost, when it goes to the store."""
        copy = self.path(number, SegmentState.CUT)
        lost = lost_commits(copy.with_name(f"{copy.name}-wal"), PAGE_BYTES)
        with (
            contextlib.suppress(Damaged),  # then it is set aside as a whole
            contextlib.closing(Segment(self.path(number), number, written=True)) as segment,
        ):
            if not segment.cut_commits:
                segment.cut(lost)
                log.error(
                    "the log of batch %d was damaged: up to %d commits are lost; %s is a copy of both",
                    number, lost, copy,
                )  # fmt: skip


def identity(folder: Path) -> str:
    """Return the name of the spool in this folder; empty if there is none, or its `id` is damaged.

    Raises:
        SpoolUnusable: it may not be read.

    """
    file = folder / "id"
    try:
        told = file.read_bytes().decode(errors="replace").strip() if file.exists() else ""
    except OSError as error:
        raise SpoolUnusable(
            f"the spool's name {file} cannot be read: {error.strerror or error}; run this as whom the spool "
            "belongs to"
        ) from error
    return told if is_identity(told) else ""


def is_identity(name: str) -> bool:
    """Return whether a spool may be called so."""
    return _ID.fullmatch(name) is not None


@contextlib.contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turn what the disk refuses within the block into `SpoolUnusable`."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SpoolUnusable(f"the spool {folder} cannot be written: {reason}") from error


def has_log(file: Path) -> bool:
    """Return whether something was written to a database and is not in its file yet."""
    log_ = file.with_name(f"{file.name}-wal")
    return log_.exists() and log_.stat().st_size > 0


def take(folder: Path) -> IO[bytes]:
    """Take the folder's lock, which ends with the process, however that ends."""
    try:
        locks.check()
        closed_folder(folder)
        lock = open(folder / "lock", "ab", opener=opener)  # noqa: SIM115 - held as long as the spool
    except locks.NoLocks as error:
        raise SpoolUnusable(str(error)) from error
    except OSError as error:
        raise SpoolUnusable(
            f"the spool's folder {folder} cannot be used: {error.strerror or error}; "
            'give another one with spool = "…" in [recorder] of the server\'s file'
        ) from error
    try:
        locks.hold(lock.fileno())
    except BlockingIOError as error:
        lock.close()
        raise SpoolUnusable(
            f"another server records into {folder}; end it first, or give this one another folder"
        ) from error
    return lock
