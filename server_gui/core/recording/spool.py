"""The spool: a folder where everything recorded is safe on this disk until it is in the store."""

import contextlib
import logging
import shutil
import sqlite3
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, Self

import msgspec

from gateway.amounts import counted
from ml.store import durable
from ml.store.precedence import opened_us
from server_gui.core.recording.errors import Damaged, NotKept, SpoolUnusable
from server_gui.core.recording.receipts import LOST, RECEIPTS, Altered, Receipt, Receipts
from server_gui.core.recording.rows import JournalHead, Record, Run
from server_gui.core.recording.segment import SUFFIXES, Segment
from server_gui.core.recording.spool_files import (
    Files,
    SegmentState,
    has_log,
    identity,
    is_identity,
    take,
    writing,
)

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


def _free_bytes(folder: Path) -> int:
    return shutil.disk_usage(folder).free


class Spool:
    """One server's spool; use it as a context manager.

    `writer` is what this opening of it is called at the store: the spool's `id`, a slash, when it was, and
    what no other opening has, because no opening can know that nobody has changed the files since the one
    before. Where the clock was set back, the time is just after the newest opening's that is known.

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
        self._files = Files(folder)
        self._reserve_bytes = reserve_bytes
        self._keep_bytes = keep_bytes
        self._free_bytes = free_bytes
        self.notices: list[str] = []  # in words: a store that is another one, a damaged id, doubts
        self.missing: str | None = None  # in words, where files that were there are not any more
        self._lock = take(folder)
        try:
            with writing(folder):
                self.receipts = Receipts(folder / RECEIPTS)
                self._files.finish_names()
                self._files.keep_damaged_logs()
                self.id = self._identify()
                durable.synchronise([folder / "id"])  # with the names of the folders above it
                self._writers = {self.id}
                self._settled: set[int] = set()  # numbers of which nothing is to be told any more
                self._heads = self._known_heads()
                self.writer = self._name()
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
        with writing(self.folder):
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
        """Age of the first row in the segment that is being written."""
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
        """Return the names at the store of earlier openings, as far as they are known."""
        newest = self.receipts.newest()
        return (self._writers | ({newest.writer} if newest else set())) - {self.writer}

    def waiting(self) -> list[int]:
        """Segments that are frozen and not uploaded, oldest first."""
        written = self._current.number  # a higher one may be in the making
        return [number for number in self._files.all_of(SegmentState.WAITING) if number < written]

    def read(self, number: int) -> Segment:
        """Return a frozen segment; close it after use.

        Raises:
            Damaged: it cannot be read, or holds nothing: one that holds nothing is never frozen.

        """
        segment = Segment(self._files.path(number), number, written=True)
        try:
            if not (segment.rows or segment.cut_commits):
                raise Damaged(f"the spool's file {segment.path} is damaged: what was written to it is gone")
        except BaseException:
            segment.close()
            raise
        return segment

    def uploaded(self, number: int) -> None:
        """Mark a segment as uploaded with its receipt: it may be deleted when room is needed.

        Raises:
            SpoolUnusable: it waits for upload as before.

        """
        self._files.rename(number, SegmentState.UPLOADED)

    def drop(self, number: int) -> None:
        """Remove a second copy, before room is needed.

        Raises:
            SpoolUnusable: it is still there.

        """
        with writing(self.folder):
            for suffix in reversed(SUFFIXES):
                file = self._files.path(number, SegmentState.UPLOADED)
                file.with_name(f"{file.name}{suffix}").unlink(missing_ok=True)
            durable.synchronise([self.folder / "id"])

    def set_aside(self, number: int) -> Path:
        """Set aside a segment that cannot be read, so that those after it are uploaded; return its file."""
        self._files.rename(number, SegmentState.DAMAGED)
        return self._files.path(number, SegmentState.DAMAGED)

    def damaged(self) -> list[Path]:
        """Files that were set aside and are still there."""
        wanted = (SegmentState.DAMAGED, SegmentState.CUT)
        return [self._files.path(number, kept) for number, kept in self._files.segments() if kept in wanted]

    def untold(self) -> dict[int, str]:
        """Batches that are lost as a whole, in words, and of which there is no receipt: set aside, or gone.

        Numbers are given one after another, and uploaded segments go oldest first: one that is skipped was
        a batch, unless its receipt says that it was uploaded.
        """
        written = self._current.number  # first: one that is begun now is no gap
        files = self._files.own()
        receipt = self.receipts.newest()
        kept = [number for number, kept in files if kept is not SegmentState.DAMAGED]
        first = min([*(number for number, _ in files), *([receipt.batch + 1] if receipt else [])], default=0)
        aside = {number for number, kept in files if kept is SegmentState.DAMAGED} - set(kept)
        gone = set(range(first, written)) - {number for number, _ in files}
        if found := (aside | gone) - self._settled:
            self._settle(found, gone)
        return {
            number: f"batch {number} of the spool {self.folder} cannot be read, and what it held is lost: "
            f"its file is kept as {self._files.path(number, SegmentState.DAMAGED).name}"
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
        """Return whether the segment was set aside, and is still there."""
        return self._files.path(number, SegmentState.DAMAGED).exists()

    def loss_name(self, number: int) -> str:
        """Return the name of this batch's loss at the store: the same on every report.

        Where an older copy of the spool takes its place, and a batch is lost under the number again, it is
        another. Raises `SpoolUnusable`.
        """
        with writing(self.folder):
            return self._files.name_loss(number, f"{self.writer}/{LOST}")

    def told(self, number: int) -> None:
        """Note that the store has the loss of this batch."""
        self._settled.add(number)

    def robots_beside(self, number: int) -> set[str]:
        """Return the robots whose rows a lost batch may have had: those of the batches beside it."""
        found: set[str] = set()
        for beside, kept in self._files.own():
            if (
                abs(beside - number) == 1
                and kept is not SegmentState.DAMAGED
                and beside < self._current.number
            ):
                with (
                    contextlib.suppress(SpoolUnusable),
                    contextlib.closing(
                        Segment(self._files.path(beside, kept), beside, written=True)
                    ) as segment,
                ):
                    found |= segment.robots()
        return found

    def backlog_bytes(self) -> int:
        """Return the size of the pending data, including the segment being written once it has rows."""
        current = self._current
        return sum(
            Segment.size_bytes(self._files.path(number))
            for number in self._files.all_of(SegmentState.WAITING)
            if number < current.number or (number == current.number and current.rows)
        )

    def make_room(self) -> bool:
        """Remove the oldest uploaded segments as far as needed; False where the disk is still nearly full.

        Raises:
            SpoolUnusable: nobody knows how full it is, or a file cannot be removed.

        """
        try:
            paths = [
                self._files.path(number, SegmentState.UPLOADED)
                for number in self._files.all_of(SegmentState.UPLOADED)
            ]
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

    def _identify(self) -> str:
        """Return the name of this spool at the store, given once.

        Of one that is damaged, as its batches have it.
        """
        if known := identity(self.folder):
            return known
        file = self.folder / "id"
        damaged, found = file.exists(), next(filter(is_identity, self._called()), None)
        named = found or str(uuid.uuid4())
        self._files.identify(named)
        if damaged or found:
            source = "what its batches call it" if found else "a new name: nothing here knows the former one"
            self._notice(f"the spool's {file} was {'damaged' if damaged else 'gone'}; it has {source} now")
        return named

    def _called(self) -> Iterator[str]:
        """Yield the spool's names in receipts and segments, the newest first."""
        receipt = self.receipts.newest()
        if receipt:
            yield receipt.spool
        for number, kept in reversed(self._files.own()):
            with (
                contextlib.suppress(SpoolUnusable),
                contextlib.closing(Segment(self._files.path(number, kept), number, written=True)) as segment,
            ):
                if segment.writer:
                    yield segment.writer.partition("/")[0]

    def _notice(self, text: str) -> None:
        log.error("%s", text)
        self.notices.append(text)

    def _name(self) -> str:
        """See `writer`, and ml/store/precedence.py."""
        newest = self.receipts.newest()
        known = max(map(opened_us, [*self._writers, *([newest.writer] if newest else [])]))
        return f"{self.id}/{max(time.time_ns() // 1000, known + 1):016}-{uuid.uuid4().hex[:12]}"

    def _known_heads(self) -> dict[str, JournalHead]:
        heads: dict[str, JournalHead] = {}
        # Each begins with what the ones before it knew; the newest may have been cut off at its making.
        newest = self._files.own()[-2:]
        for number, kept in newest:
            if kept is not SegmentState.DAMAGED:
                written = (number, kept) != newest[-1] or has_log(self._files.path(number, kept))
                heads |= self._heads_of(number, kept, written=written)
        return heads

    def _heads_of(self, number: int, kept: SegmentState, *, written: bool) -> dict[str, JournalHead]:
        try:
            found = Segment(self._files.path(number, kept), number, written=written)
            with contextlib.closing(found) as segment:
                self._writers.add(segment.writer or self.id)
                return segment.heads()
        except Damaged as error:
            if kept is SegmentState.WAITING:
                log.error("%s; it is kept as %s", error, self.set_aside(number))
            return {}

    def _resume(self) -> Segment:
        """Return the segment to write now: a new one, unless the newest is still empty."""
        newest, kept = self._files.own()[-1] if self._files.own() else (0, SegmentState.UPLOADED)
        receipt = self.receipts.newest()
        known = receipt.batch if receipt else 0
        if known > newest:
            self.missing = (
                f"files are missing in the spool {self.folder}: batch {known} was uploaded from it, and the "
                f"newest there is {newest}. What was not uploaded of them is lost"
            )
            log.error("%s", self.missing)
        if kept is not SegmentState.WAITING or known > newest:
            return self._begin(max(newest, known) + 1)
        try:
            segment = self._begin(newest)
        except Damaged as error:
            log.error("%s; what can be read of it goes to the store", error)
            return self._begin(newest + 1)
        if not (segment.rows or segment.cut_commits):
            return segment
        segment.close()
        return self._begin(newest + 1)

    def _begin(self, number: int) -> Segment:
        segment = Segment(self._files.path(number), number)
        try:
            segment.check_columns()
            with writing(self.folder):
                if not segment.rows:
                    segment.name(self.writer)
                segment.append((), (), self._heads)
                durable.sync(self.folder)
        except BaseException:
            segment.close()
            raise
        self._began_ns = None
        return segment
