"""The spool: a folder where everything recorded is safe on this disk until it is in the store.

`00000007.db` is a segment; the highest number is written, all others are frozen, and a segment's number is
the batch's sequence number at the store, for ever. `00000006.uploaded.db` is in the store and goes when room
is needed. `00000005.damaged.db` cannot be read, or runs of it cannot: these are not in the store, and it
stays for somebody to look at. The highest number is never removed, so that no number is given twice; should
somebody have removed files, what is written from then on goes to the store under another `writer` anyway.
`00000004.cut.db` is a copy of a segment whose log was damaged, as it was found: commits at its end are lost.
`receipts.jsonl` says what of each segment is in the store (receipts.py).
"""

import contextlib
import fcntl
import logging
import os
import re
import shutil
import sqlite3
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import IO, Final, Self

import msgspec

from gateway.cli.text import counted
from ml.store import durable
from ml.store.private import closed_folder, opener
from server_gui.core.recording.errors import Damaged, NotKept, SpoolUnusable
from server_gui.core.recording.receipts import RECEIPTS, Altered, Receipt, Receipts
from server_gui.core.recording.rows import JournalHead, Record, Run
from server_gui.core.recording.segment import PAGE_BYTES, SUFFIXES, Segment
from server_gui.core.recording.wal import lost_commits

log = logging.getLogger(__name__)

RESERVE_BYTES: Final = 1 << 30  # what the disk must have left for recording to go on
KEEP_BYTES: Final = 4 << 30  # uploaded segments that stay as a second copy, while there is room
UNFIT: Final = (  # what a segment raises because of the rows themselves
    sqlite3.IntegrityError,
    sqlite3.ProgrammingError,
    sqlite3.InterfaceError,
    sqlite3.DataError,
    msgspec.MsgspecError,
    OverflowError,
    TypeError,
    ValueError,
)
_ID: Final = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_NAME: Final = re.compile(r"(\d{8})(\.uploaded|\.damaged|\.cut)?\.db")


class Kept(Enum):
    """What has become of a segment; as its file's name says."""

    WAITING = ""
    UPLOADED = ".uploaded"
    DAMAGED = ".damaged"
    CUT = ".cut"  # not the segment itself, but a copy for somebody to look at


def _free_bytes(folder: Path) -> int:
    return shutil.disk_usage(folder).free


class Spool:
    """One server's spool; use it as a context manager.

    `writer` is what this opening of it is called at the store: the spool's `id`, a slash, and what no other
    opening has, because no opening can know that nobody has changed the files since the one before.

    `append` and `freeze` belong to one thread, the recorder's. Everything else may be called from others.

    Raises:
        SpoolUnusable: the folder cannot be used, or another process uses it.

    """

    def __init__(
        self,
        folder: Path,
        reserve_bytes: int = RESERVE_BYTES,
        keep_bytes: int = KEEP_BYTES,
        free_bytes: Callable[[Path], int] = _free_bytes,
    ) -> None:
        self.folder = folder
        self._reserve_bytes = reserve_bytes
        self._keep_bytes = keep_bytes
        self._free_bytes = free_bytes
        self.notices: list[
            str
        ] = []  # in words: a store that is another one than before, a damaged id, doubts
        self.missing: str | None = None  # in words, where files that were there are not any more
        self._lock = _take(folder)
        try:
            with _writing(folder):
                self.receipts = Receipts(folder / RECEIPTS)
                self._look_at_names()
                self._look_at_logs()
                self.id = self._identify()
                durable.synchronise([folder / "id"])  # with the names of the folders above it
                self.writer = f"{self.id}/{uuid.uuid4().hex[:12]}"
                self._writers = {self.id}
                self._settled: set[int] = set()  # numbers of which nothing is to be told any more
                self._heads = self._known_heads()
                self._began_ns: int | None = None
                self._current = self._resume()
                self.first = self._current.number  # of what this opening writes
        except BaseException:
            self._lock.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the folder; what is in it stays. Idempotent."""
        self._current.close()
        self._lock.close()

    # --- the recorder's thread

    def append(
        self, runs: Sequence[Run], records: Sequence[Record], heads: Mapping[str, JournalHead] | None = None
    ) -> None:
        """Keep all of this or nothing; safe from now on when this returns.

        Raises:
            NotKept: nothing was kept, because of what it is; in parts the rest of it may be.
            SpoolUnusable: nothing was kept; the message says why.

        """
        with _writing(self.folder):
            try:
                self._current.append(runs, records, heads or {})
            except UNFIT as error:
                raise NotKept(f"the spool {self.folder} does not take it: {error}") from error
        self._heads.update(heads or {})
        if self._began_ns is None and self._current.rows:
            self._began_ns = time.monotonic_ns()

    @property
    def rows(self) -> int:
        """Rows in the segment that is being written."""
        return self._current.rows

    @property
    def age_s(self) -> float:
        """How long the first row in the segment that is being written has been there."""
        return 0.0 if self._began_ns is None else (time.monotonic_ns() - self._began_ns) / 1e9

    @property
    def heads(self) -> Mapping[str, JournalHead]:
        """Up to where each robot's journal has been recorded."""
        return self._heads

    def freeze(self) -> None:
        """End the segment that is being written, if there is anything in it; it waits for upload then.

        Raises:
            SpoolUnusable: a new segment cannot be made; the old one is written on.

        """
        if self._current.rows:
            following = self._begin(self._current.number + 1)
            self._current.close()
            self._current = following

    # --- any thread

    def earlier_writers(self) -> set[str]:
        """What the openings before this one were called at the store, as far as anybody knows."""
        newest = self.receipts.newest()
        return (self._writers | ({newest.writer} if newest else set())) - {self.writer}

    def waiting(self) -> list[int]:
        """Segments that are frozen and not uploaded, oldest first."""
        written = self._current.number  # a higher one may be in the making
        return [number for number in self._all(Kept.WAITING) if number < written]

    def read(self, number: int) -> Segment:
        """A frozen segment; close it after use.

        Raises:
            Damaged: it cannot be read, or holds nothing: one that holds nothing is never frozen.

        """
        segment = Segment(self._path(number), number, written=True)
        try:
            if not (segment.rows or segment.cut_commits):
                raise Damaged(f"the spool's file {segment.path} is damaged: what was written to it is gone")
        except BaseException:
            segment.close()
            raise
        return segment

    def uploaded(self, number: int) -> None:
        """The segment is in the store, durably, and has its receipt: it may go when room is needed.

        Raises:
            SpoolUnusable: it waits for upload as before.

        """
        self._name(number, Kept.UPLOADED)

    def set_aside(self, number: int) -> Path:
        """The segment cannot be read: it waits no longer, so that those after it are uploaded; its file."""
        self._name(number, Kept.DAMAGED)
        return self._path(number, Kept.DAMAGED)

    def damaged(self) -> list[Path]:
        """Files that were set aside and are still there."""
        wanted = (Kept.DAMAGED, Kept.CUT)
        return [self._path(number, kept) for number, kept in self._segments() if kept in wanted]

    def untold(self) -> dict[int, str]:
        """Batches that are lost as a whole, in words, and of which there is no receipt: set aside, or gone.

        Numbers are given one after another, and uploaded segments go oldest first: one that is skipped was
        a batch, unless its receipt says that it was uploaded.
        """
        files = self._own()
        receipt = self.receipts.newest()
        kept = [number for number, kept in files if kept is not Kept.DAMAGED]
        first = min([*kept, *([receipt.batch + 1] if receipt else [])], default=0)
        aside = {number for number, kept in files if kept is Kept.DAMAGED} - set(kept)
        gone = set(range(first, self._current.number)) - {number for number, _ in files}
        if found := (aside | gone) - self._settled:
            self._settle(found, gone)
        return {
            number: f"batch {number} of the spool {self.folder} cannot be read, and what it held is lost: "
            f"its file is kept as {self._path(number, Kept.DAMAGED).name}"
            if number in aside
            else f"batch {number} of the spool {self.folder} is gone: its file is not there, and no receipt "
            "says that it was uploaded"
            for number in sorted(found - self._settled)
        }

    def _settle(self, found: set[int], gone: set[int]) -> None:
        """Tell nothing of those that have a receipt, nor where a receipt that is damaged may be of them."""
        lines = list(self.receipts.all())
        known = {each.batch for each in lines if isinstance(each, Receipt) and each.is_of_batch}
        altered = [each.line for each in lines if isinstance(each, Altered)]
        if altered and (doubtful := sorted((found & gone) - known)):
            self._notice(
                f"the files of {counted(len(doubtful), 'batch', 'batches')} of the spool {self.folder} (from "
                f"batch {doubtful[0]} on) are not there, and line {altered[0]} of its {RECEIPTS} is damaged: "
                "nobody can say whether they were uploaded. Bring that file back from a copy, and start again"
            )
            known.update(doubtful)
        self._settled |= found & known

    def is_aside(self, number: int) -> bool:
        """Whether the segment was set aside, and is still there."""
        return self._path(number, Kept.DAMAGED).exists()

    def told(self, number: int) -> None:
        """The store knows that this batch is lost."""
        self._settled.add(number)

    def robots_beside(self, number: int) -> set[str]:
        """Whose rows a batch that is lost may have had: those that the ones before and after it know."""
        found: set[str] = set()
        for beside, kept in self._own():
            if abs(beside - number) == 1 and kept is not Kept.DAMAGED and beside < self._current.number:
                with (
                    contextlib.suppress(SpoolUnusable),
                    contextlib.closing(Segment(self._path(beside, kept), beside, written=True)) as segment,
                ):
                    found |= segment.robots()
        return found

    def backlog_bytes(self) -> int:
        """What waits for upload, with what is being written."""
        return sum(Segment.size_bytes(self._path(number)) for number in self._all(Kept.WAITING))

    def make_room(self) -> bool:
        """Remove the oldest uploaded segments as far as needed; False where the disk is still nearly full.

        Raises:
            SpoolUnusable: nobody knows how full it is, or a file cannot be removed.

        """
        try:
            paths = [self._path(number, Kept.UPLOADED) for number in self._all(Kept.UPLOADED)]
            kept = sum(map(Segment.size_bytes, paths))
            for path in paths:
                if kept <= self._keep_bytes and self._roomy():
                    break
                kept -= Segment.size_bytes(path)
                Segment.remove(path)
            return self._roomy()
        except OSError as error:
            reason = error.strerror or error
            raise SpoolUnusable(f"no room can be made in the spool {self.folder}: {reason}") from error

    def _roomy(self) -> bool:
        return self._free_bytes(self.folder) >= self._reserve_bytes

    # --- files

    def _path(self, number: int, kept: Kept = Kept.WAITING) -> Path:
        return self.folder / f"{number:08}{kept.value}.db"

    def _name(self, number: int, kept: Kept) -> None:
        """Call a segment that has waited by another name, with its log, which a reader may keep open."""
        with _writing(self.folder):
            for suffix in SUFFIXES:
                file = self._path(number).with_name(self._path(number).name + suffix)
                if file.exists():
                    file.rename(file.with_name(self._path(number, kept).name + suffix))
            _sync(self.folder)

    def _look_at_names(self) -> None:
        """What was cut off when a segment got another name goes on."""
        for number, kept in self._own():
            file = self._path(number)
            left = file.with_name(f"{file.name}-wal").exists() and not file.exists()
            if left and kept is not Kept.WAITING:
                self._name(number, kept)

    def _segments(self) -> list[tuple[int, Kept]]:
        try:
            names = [_NAME.fullmatch(path.name) for path in self.folder.iterdir()]
        except OSError as error:
            reason = error.strerror or error
            raise SpoolUnusable(f"the spool {self.folder} cannot be read: {reason}") from error
        found = [(int(name[1]), Kept(name[2] or "")) for name in names if name]
        return sorted(found, key=lambda each: (each[0], each[1].value))

    def _own(self) -> list[tuple[int, Kept]]:
        """The segments themselves, without copies."""
        return [(number, kept) for number, kept in self._segments() if kept is not Kept.CUT]

    def _all(self, wanted: Kept) -> list[int]:
        return [number for number, kept in self._segments() if kept is wanted]

    def _identify(self) -> str:
        """The name of this spool at the store, given once; of one that is damaged, as its batches have it."""
        if known := identity(self.folder):
            return known
        file = self.folder / "id"
        damaged, found = file.exists(), next(filter(_ID.fullmatch, self._called()), None)
        named = found or str(uuid.uuid4())
        draft = file.with_name("id.draft")
        with open(draft, "w", opener=opener) as out:
            out.write(f"{named}\n")
            out.flush()
            os.fsync(out.fileno())
        draft.rename(file)
        _sync(self.folder)
        if damaged or found:
            source = "what its batches call it" if found else "a new name: nothing here knows the former one"
            self._notice(f"the spool's {file} was {'damaged' if damaged else 'gone'}; it has {source} now")
        return named

    def _called(self) -> Iterator[str]:
        """What receipts and segments call this spool, the newest first."""
        receipt = self.receipts.newest()
        if receipt:
            yield receipt.writer.partition("/")[0]
        for number, kept in reversed(self._own()):
            with (
                contextlib.suppress(SpoolUnusable),
                contextlib.closing(Segment(self._path(number, kept), number, written=True)) as segment,
            ):
                if segment.writer:
                    yield segment.writer.partition("/")[0]

    def _notice(self, text: str) -> None:
        log.error("%s", text)
        self.notices.append(text)

    def _look_at_logs(self) -> None:
        """Before SQLite reads a log up to where it is damaged, and forgets the rest: keep it as it is."""
        for number in self._all(Kept.WAITING):
            log_ = self._path(number).with_name(f"{self._path(number).name}-wal")
            if lost_commits(log_, PAGE_BYTES) and number not in self._all(Kept.CUT):
                self._copy(number)
        for number in sorted(set(self._all(Kept.CUT)) & set(self._all(Kept.WAITING))):
            self._cut(number)

    def _copy(self, number: int) -> None:
        """The database last: where that is there, all of the copy is."""
        for suffix in reversed(SUFFIXES):
            source = self._path(number).with_name(self._path(number).name + suffix)
            if not source.exists():  # the log's index; SQLite makes it anew
                continue
            target = self._path(number, Kept.CUT).with_name(self._path(number, Kept.CUT).name + suffix)
            draft = target.with_name(f"{target.name}.draft")
            with source.open("rb") as content, open(draft, "wb", opener=opener) as out:
                shutil.copyfileobj(content, out)
                out.flush()
                os.fsync(out.fileno())
            draft.rename(target)
        _sync(self.folder)

    def _cut(self, number: int) -> None:
        """Let the segment itself tell what it has lost, when it goes to the store."""
        copy = self._path(number, Kept.CUT)
        lost = lost_commits(copy.with_name(f"{copy.name}-wal"), PAGE_BYTES)
        with (
            contextlib.suppress(Damaged),  # then it is set aside as a whole
            contextlib.closing(Segment(self._path(number), number, written=True)) as segment,
        ):
            if not segment.cut_commits:
                segment.cut(lost)
                log.error(
                    "the log of batch %d was damaged: up to %d commits are lost; %s is a copy of both",
                    number, lost, copy,
                )  # fmt: skip

    def _known_heads(self) -> dict[str, JournalHead]:
        heads: dict[str, JournalHead] = {}
        # Each begins with what the ones before it knew; the newest may have been cut off at its making.
        newest = self._own()[-2:]
        for number, kept in newest:
            if kept is not Kept.DAMAGED:
                written = (number, kept) != newest[-1] or _has_log(self._path(number, kept))
                heads |= self._heads_of(number, kept, written=written)
        return heads

    def _heads_of(self, number: int, kept: Kept, *, written: bool) -> dict[str, JournalHead]:
        try:
            found = Segment(self._path(number, kept), number, written=written)
            with contextlib.closing(found) as segment:
                self._writers.add(segment.writer or self.id)
                return segment.heads()
        except Damaged as error:
            if kept is Kept.WAITING:
                log.error("%s; it is kept as %s", error, self.set_aside(number))
            return {}

    def _resume(self) -> Segment:
        """The segment to write now: a new one, unless the newest is still empty."""
        newest, kept = self._own()[-1] if self._own() else (0, Kept.UPLOADED)
        receipt = self.receipts.newest()
        known = receipt.batch if receipt else 0
        if known > newest:
            self.missing = (
                f"files are missing in the spool {self.folder}: batch {known} was uploaded from it, and the "
                f"newest there is {newest}. What was not uploaded of them is lost"
            )
            log.error("%s", self.missing)
        if kept is not Kept.WAITING or known > newest:
            return self._begin(max(newest, known) + 1)
        segment = self._begin(newest)
        if not (segment.rows or segment.cut_commits):
            return segment
        segment.close()
        return self._begin(newest + 1)

    def _begin(self, number: int) -> Segment:
        segment = Segment(self._path(number), number)
        try:
            with _writing(self.folder):
                if not segment.rows:
                    segment.name(self.writer)
                segment.append((), (), self._heads)
                _sync(self.folder)
        except BaseException:
            segment.close()
            raise
        self._began_ns = None
        return segment


@contextlib.contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Turn what the disk refuses within the block into `SpoolUnusable`."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SpoolUnusable(f"the spool {folder} cannot be written: {reason}") from error


def identity(folder: Path) -> str:
    """What the spool in this folder is called; nothing where there is none, or its `id` is damaged."""
    file = folder / "id"
    told = file.read_bytes().decode(errors="replace").strip() if file.exists() else ""
    return told if _ID.fullmatch(told) else ""


def _has_log(file: Path) -> bool:
    log_ = file.with_name(f"{file.name}-wal")
    return log_.exists() and log_.stat().st_size > 0


def _take(folder: Path) -> IO[bytes]:
    """The folder's lock, which ends with the process, however that ends."""
    try:
        closed_folder(folder)
        lock = open(folder / "lock", "ab", opener=opener)  # noqa: SIM115 - held as long as the spool
    except OSError as error:
        raise SpoolUnusable(
            f"the spool's folder {folder} cannot be used: {error.strerror or error}; "
            'give another one with spool = "…" in [recorder] of the server\'s file'
        ) from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        lock.close()
        raise SpoolUnusable(
            f"another server records into {folder}; end it first, or give this one another folder"
        ) from error
    return lock


def _sync(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
