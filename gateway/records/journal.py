"""The journal: who did what, when, and what came of it. Appended, made durable, hash-chained.

Its own thread writes, all that waits at once, so that a slow disk delays nobody but who chooses to wait.
The newest hash is also kept beside the journal (`.head`), because a chain alone does not show that its end
was cut off. A file that has got large is closed as a piece; the oldest pieces are removed, which the journal
says. It is read in another thread, from descriptors of its own (ADR 13).
"""

import contextlib
import logging
import os
import queue
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Final, TypeVar

import msgspec

from drivers.inbox import Inbox
from gateway.process.futures import failed
from gateway.records import durable, journal_files
from gateway.records.chain import Broken, Head, line
from gateway.records.journal_files import ClosedJournalFile, Entry, Tail, head_file, read_head
from gateway.records.limits import OWN, Limits, Share, TooMany, within_limits
from gateway.records.reading import SHORTENED, read_verified

__all__ = ["Entry", "Journal", "Share", "Sizes", "Tail", "TooMany", "head_file", "read_head", "read_verified"]

log = logging.getLogger(__name__)

Found = TypeVar("Found")

AT_ONCE: Final = 256  # entries that become durable together
_CLOSED: Final = "the journal is closed, the gateway is ending"


@dataclass(frozen=True, slots=True)
class Sizes:
    """Maximum sizes of the journal's files, in bytes."""

    piece: int = 8 * 1024 * 1024  # one that has so many is closed
    kept: int = 256 * 1024 * 1024  # all closed ones together; the newest of them is kept in any case


@dataclass(slots=True)
class _Waiting:
    """An entry; or, without fields, somebody who wants to know the newest one."""

    fields: Entry | None
    future: "Future[Any]" = field(default_factory=Future)


class Journal:
    """One robot's journal; any thread may append. Where it is `unusable`, every entry fails and says so."""

    def __init__(
        self, path: Path, boot_id: str, unusable: str | None = None, sizes: Sizes | None = None
    ) -> None:
        self.path = path
        self.problem = unusable  # why the last entry could not be written
        self._unusable = unusable
        self._boot_id = boot_id
        self._sizes = sizes or Sizes()
        self._head = Head()
        self._room: Entry = {}  # goes with the next entry
        self._file: BinaryIO | None = None
        self._queue: Inbox[_Waiting | None] = Inbox()
        self._limits = Limits()
        self._limiting = threading.Lock()  # never taken for the gateway's own entries: a stop tells some
        self._ended = False
        self._reader = ThreadPoolExecutor(max_workers=1, thread_name_prefix="journal reader")
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def append(self, who: str, what: str, share: Share = Share.OUTCOME, /, **details: Any) -> "Future[None]":
        """Add an entry of this instant. The future is done when it is durable.

        It fails with `OSError` where it cannot be written; then the journal is as it was before. `TooMany`
        says that its client has written too many, as far as its `share` is limited.
        """
        now_ns = time.monotonic_ns()
        fields = {**self._now(now_ns), "who": who, "what": what, **details}
        size = 0
        with contextlib.suppress(Exception):  # what cannot be encoded is found where it is written
            fields, size = within_limits(fields)
        refusal = None if who in OWN else self._refusal(who, what, share, size, now_ns)
        return self._submit(_Waiting(fields)) if refusal is None else failed(TooMany(refusal))

    def tail(self, count: int) -> "Future[Tail]":
        """Return the newest entries, also those that are being written now; reading delays no other entry."""
        found: Future[Tail] = Future()
        newest: Future[Head] = self._submit(_Waiting(None))
        newest.add_done_callback(
            lambda newest: self._begin_reading(lambda: self._read(count, newest.result().n), found)
        )
        return found

    def with_head(self, work: Callable[[Head], Found]) -> "Future[Found]":
        """Return the result of `work` on the newest entry, in the reading thread.

        It delays no entry either.
        """
        found: Future[Found] = Future()
        newest: Future[Head] = self._submit(_Waiting(None))
        newest.add_done_callback(lambda newest: self._begin_reading(lambda: work(newest.result()), found))
        return found

    def close(self) -> None:
        """Write the appended entries, and end. Idempotent."""
        if not self._ended:
            self._queue.put(None)
            self._thread.join()
            self._ended = True
            self._fail_all()
        self._reader.shutdown(wait=True)
        if self._file is not None:
            self._file.close()
            self._file = None

    def _now(self, now_ns: int) -> Entry:
        return {"utc_ns": time.time_ns(), "monotonic_ns": now_ns, "boot_id": self._boot_id}

    def _refusal(self, who: str, what: str, share: Share, size: int, now_ns: int) -> str | None:
        """Return why it is not written; the thread learns that there is something to sum up."""
        with self._limiting:
            before = self._limits.patience_s(now_ns)
            refusal = self._limits.refusal(who, what, share, size, now_ns)
        if refusal is not None and before is None:
            self._submit(_Waiting(None))
        return refusal

    def _submit(self, waiting: _Waiting) -> "Future[Any]":
        self._queue.put(waiting)
        if self._ended:
            self._fail_all()
        return waiting.future

    def _fail_all(self) -> None:
        """Fail entries that came too late; any thread with a queued entry may do it."""
        with contextlib.suppress(queue.Empty):
            while True:
                late = self._queue.get_nowait()
                if late is not None:
                    late.future.set_exception(OSError(None, _CLOSED))

    # In the journal's thread.

    def _run(self) -> None:
        ended = False
        while not ended:
            taken = self._take()
            ended = None in taken
            batch = [*(one for one in taken if one is not None), *self._summaries(ended)]
            self._do_whatever_comes([one for one in batch if one.future.set_running_or_notify_cancel()])

    def _take(self) -> list[_Waiting | None]:
        """All that waits now, or comes before something is to be summed up; `None` is the end."""
        with self._limiting:
            patience_s = self._limits.patience_s(time.monotonic_ns())
        taken: list[_Waiting | None] = []
        with contextlib.suppress(queue.Empty):
            taken.append(self._queue.get(timeout=patience_s))
            while len(taken) < AT_ONCE and taken[-1] is not None:
                taken.append(self._queue.get_nowait())
        return taken

    def _summaries(self, ended: bool) -> list[_Waiting]:
        now_ns = time.monotonic_ns()
        with self._limiting:
            due = self._limits.summaries(None if ended else now_ns)
        for summary in due:
            log.warning("the journal: %s", summary["result"])
        return [_Waiting({**self._now(now_ns), **summary}) for summary in due]

    def _do_whatever_comes(self, batch: Sequence[_Waiting]) -> None:
        """Run the thread, which survives every failure, so that nobody waits for ever."""
        try:
            self._do(batch)
        except Exception as error:
            log.exception("the journal's thread failed")
            for one in batch:
                if not one.future.done():
                    one.future.set_exception(OSError(None, f"the journal failed: {error}"))

    def _do(self, batch: Sequence[_Waiting]) -> None:
        entries = [one for one in batch if one.fields is not None]
        if entries:
            self._write(entries)
        asking = [one for one in batch if one.fields is None]
        if asking:
            self._tell_newest(asking)

    def _write(self, entries: Sequence[_Waiting]) -> None:
        """All of them at once; whoever waits is told, and what fails is logged."""
        if self._unusable is not None:
            for one in entries:
                log.error("the journal cannot be written: %s; lost: %s", self._unusable, one.fields)
                one.future.set_exception(OSError(None, self._unusable))
            return
        try:
            errors = self._put(entries)
        except Exception as error:  # noqa: BLE001 - whoever waits is told that nothing was written
            errors = {number: error for number, _ in enumerate(entries)}
        if len(errors) < len(entries):
            self.problem = None
        for number, one in enumerate(entries):
            if number in errors:
                self._fail(one, errors[number])
            else:
                one.future.set_result(None)

    def _fail(self, waiting: _Waiting, error: Exception) -> None:
        why = getattr(error, "strerror", None) or error
        self.problem = f"{self.path} cannot be written: {why}; make room or correct its rights"
        log.error("the journal: %s; lost: %s", self.problem, waiting.fields)
        failure = OSError(getattr(error, "errno", None), self.problem)
        failure.__cause__ = error
        waiting.future.set_exception(failure)

    def _put(self, entries: Sequence[_Waiting]) -> dict[int, Exception]:
        """Append those that can be encoded; returns why the others cannot."""
        self._make_room(self._file or self._open())
        errors: dict[int, Exception] = {}
        head, lines = self._head, []
        for number, one in enumerate(entries):
            try:
                data, head = line(head, {**(one.fields or {}), **self._room})
            except Exception as error:  # noqa: BLE001 - it is this entry's alone
                errors[number] = error
            else:
                lines.append(data + b"\n")
                self._room = {}
        if lines:
            self._append(b"".join(lines), head)
        return errors

    def _append(self, data: bytes, head: Head) -> None:
        file = self._file or self._open()
        with self._as_before_if_it_fails(file):
            _append(file, data)
            durable.write(head_file(self.path), msgspec.json.encode(head))
        self._head = head

    def _say(self, what: str, **details: Any) -> None:
        """Append an entry of the journal's own."""
        fields = {**self._now(time.monotonic_ns()), "who": "gateway", "what": what, **details}
        data, head = line(self._head, {**fields, **self._room})
        self._append(data + b"\n", head)
        self._room = {}

    @contextlib.contextmanager
    def _as_before_if_it_fails(self, file: BinaryIO) -> Iterator[None]:
        """Take back what fails: an entry reported lost stands neither in the journal nor in its head."""
        size = file.seek(0, os.SEEK_END)
        try:
            yield
        except Exception:
            self._file = None  # whatever is there now, the next entry follows it
            with contextlib.suppress(OSError), file:
                os.ftruncate(file.fileno(), size)
                os.fsync(file.fileno())
            with contextlib.suppress(OSError):  # also where that has failed: the head must not say more
                durable.write(head_file(self.path), msgspec.json.encode(self._head))
            raise

    def _tell_newest(self, asking: Sequence[_Waiting]) -> None:
        error: OSError | None = None if self._unusable is None else OSError(None, self._unusable)
        try:
            if error is None and self._file is None:
                self._open()
        except Exception as failure:  # noqa: BLE001 - it belongs to who asks
            error = OSError(getattr(failure, "errno", None), f"{self.path} cannot be read: {failure}")
        for one in asking:
            if error is None:
                one.future.set_result(self._head)
            else:
                one.future.set_exception(error)

    # Opening, closing and removing pieces; in the journal's thread.

    def _open(self) -> BinaryIO:
        """Open it behind its last whole line; what a crash has left half-written is cut off and said."""
        said = self._take_up()
        file = self.path.open("a+b", buffering=0)
        try:
            durable.sync_folder(self.path.parent)
        except BaseException:
            file.close()
            raise
        self._file = file
        self._room = _room(self.path, self._sizes)
        if said is not None:
            log.warning("the journal %s: %s", self.path, said)
            self._say("journal damaged", result=said)
        return file

    def _take_up(self) -> str | None:
        """Find the newest entry; says what is wrong with the journal's end."""
        with self.path.open("a+b", buffering=0) as file:
            end = journal_files.end_of_last_line(file)
            torn = file.seek(0, os.SEEK_END) - end
            if torn:
                os.ftruncate(file.fileno(), end)
        try:
            last = journal_files.newest_line(self.path)
            self._head = journal_files.hash_of(last) if last is not None else Head()
            known = read_head(self.path)
        except Broken as error:
            return self._set_aside(str(error))
        if known is not None and known.n > self._head.n:
            return f"{known.n - self._head.n} entries are missing at its end"
        return f"its last entry was cut by a crash: {torn} bytes were removed" if torn else None

    def _set_aside(self, why: str) -> str:
        """Nothing can follow what does not hold: begin anew, and keep the old one to be looked at.

        The file that shows the damage goes last: after a crash in between the rest is set aside too.
        """
        kept = self.path.with_name(f"{self.path.name}.broken-{time.time_ns()}")
        for piece in journal_files.closed_pieces(self.path):
            piece.path.replace(journal_files.closed_piece(kept, piece.last).path)
        self.path.replace(kept)
        self._head = Head()
        return f"{why}; the journal begins anew, the old one is {kept.name}"

    def _make_room(self, file: BinaryIO) -> None:
        """Close a file that has got large as a piece, and begin another one.

        The old name is durable before there is a new file, so that a crash at any point leaves every line.
        """
        if file.seek(0, os.SEEK_END) < self._sizes.piece:
            return
        closed = journal_files.closed_piece(self.path, self._head.n)
        try:
            if closed.path.exists():
                raise FileExistsError(None, f"{closed.path.name} is there already")
            self.path.replace(closed.path)
        except OSError as error:
            log.warning("the journal goes on in one large file: %s", error.strerror or error)
            return
        self._file = None
        file.close()
        durable.sync_folder(self.path.parent)
        self._open()
        self._shorten()

    def _shorten(self) -> None:
        """Remove the oldest pieces beyond what is kept, which the journal says before."""
        surplus = self._surplus()
        if not surplus:
            return
        last = surplus[-1]
        self._say(
            SHORTENED,
            up_to=last.last,
            up_to_hash=_last_hash(last),
            result=f"entries up to {last.last} were removed: all that is kept has {self._sizes.kept} bytes",
        )
        try:
            for piece in surplus:
                piece.path.unlink(missing_ok=True)
            durable.sync_folder(self.path.parent)
        except OSError as error:
            log.warning("old pieces of the journal cannot be removed: %s", error.strerror or error)

    def _surplus(self) -> list[ClosedJournalFile]:
        closed = journal_files.closed_pieces(self.path)
        left = self._sizes.kept
        for index in range(len(closed) - 1, -1, -1):
            left -= closed[index].path.stat().st_size
            if left < 0:
                return closed[: min(index + 1, len(closed) - 1)]
        return []

    # In the reader's thread.

    def _begin_reading(self, work: Callable[[], Found], found: "Future[Found]") -> None:
        """In whichever thread has found out up to where it may be read."""
        try:
            reading = self._reader.submit(work)
        except Exception as error:  # noqa: BLE001 - it belongs to who asks
            found.set_exception(error if isinstance(error, OSError) else OSError(None, _CLOSED))
        else:
            reading.add_done_callback(lambda reading: _pass_on(reading, found))

    def _read(self, count: int, newest: int) -> Tail:
        try:
            return journal_files.tail(self.path, count, newest)
        except Broken as error:
            raise OSError(None, f"{self.path} is damaged: {error}") from error


def _pass_on(reading: "Future[Found]", found: "Future[Found]") -> None:
    error = reading.exception()
    if error is None:
        found.set_result(reading.result())
    else:
        found.set_exception(error)


def _append(file: BinaryIO, data: bytes) -> None:
    """Append and make durable."""
    written = file.write(data)
    if written != len(data):
        raise OSError(None, f"only {written} of {len(data)} bytes could be written")
    os.fsync(file.fileno())


def _last_hash(piece: ClosedJournalFile) -> str | None:
    """Return the hash of the last line, to which the next one refers; `None` if the piece is damaged."""
    try:
        with piece.path.open("rb") as file:
            last = next(journal_files.lines_backwards(file), None)
        return None if last is None else journal_files.hash_of(last).hash
    except Broken:
        return None


def _room(journal: Path, sizes: Sizes) -> Entry:
    """Return the first entry, with the room on the journal's file system.

    The log where it is little.
    """
    folder = journal.parent
    try:
        found = os.statvfs(folder)
        has = (
            sum(one.path.stat().st_size for one in journal_files.closed_pieces(journal))
            + journal.stat().st_size
        )
    except OSError as error:
        log.warning("how much room there is in %s cannot be seen: %s", folder, error.strerror or error)
        return {}
    free, wanted = found.f_bavail * found.f_frsize, max(0, sizes.kept + 2 * sizes.piece - has)
    if free < wanted:
        log.warning(
            "%d MB are free in %s, and the journal may grow by %d MB: make room; without it no write is done",
            free // 1_000_000,
            folder,
            wanted // 1_000_000,
        )
    return {"room": {"free_bytes": free, "may_grow_bytes": wanted}}
