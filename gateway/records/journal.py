"""The journal: who did what, when, and what came of it. Appended, made durable, hash-chained.

Its own thread writes, so that a slow disk delays nobody but who chooses to wait. The newest hash is also
kept beside the journal (`.head`), because a chain alone does not show that its end was cut off.
"""

import contextlib
import logging
import os
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, BinaryIO

import msgspec

from gateway.records import durable
from gateway.records.chain import UNDECODABLE, Broken, Head, check, line, verify

log = logging.getLogger(__name__)

Entry = dict[str, Any]
_TAIL_BYTES = 64 * 1024


def head_file(journal: Path) -> Path:
    """Where the newest hash of a journal is kept."""
    return journal.with_name(f"{journal.name}.head")


def read_head(journal: Path) -> Head | None:
    """What the journal is known to reach; `None` where nobody wrote it down.

    Raises:
        Broken: the head's file is damaged.

    """
    try:
        return msgspec.json.decode(head_file(journal).read_bytes(), type=Head)
    except FileNotFoundError:
        return None
    except UNDECODABLE as error:
        raise Broken(f"{head_file(journal).name} is damaged: {error}") from error


def read_verified(journal: Path) -> list[Entry]:
    """Every entry of a journal whose chain holds.

    Raises:
        Broken: it does not; the message says where.
        OSError: it cannot be read.

    """
    head = read_head(journal)
    if not journal.exists() and head is not None and head.n:
        raise Broken(f"{journal} is missing: {head.n} entries were written")
    with journal.open("rb") as file:
        return list(verify(file, head))


class Journal:
    """One robot's journal; any thread may append. Where it is `unusable`, every entry fails and says so."""

    def __init__(self, path: Path, boot_id: str, unusable: str | None = None) -> None:
        self.path = path
        self.problem = unusable  # why the last entry could not be written
        self._unusable = unusable
        self._boot_id = boot_id
        self._head = Head()
        self._file: BinaryIO | None = None
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="journal")

    def append(self, who: str, what: str, **details: Any) -> "Future[None]":
        """Add an entry of this instant. The future is done when it is durable.

        It fails with `OSError` where it cannot be written; then the journal is as it was before.
        """
        fields: Entry = {
            "utc_ns": time.time_ns(),
            "monotonic_ns": time.monotonic_ns(),
            "boot_id": self._boot_id,
            "who": who,
            "what": what,
            **details,
        }
        return self._writer.submit(self._append, fields)

    def tail(self, count: int) -> "Future[list[Entry]]":
        """The newest entries, oldest first, also those that are being written now."""
        return self._writer.submit(lambda: self._tail(count))

    def close(self) -> None:
        """Write what was appended, and end. Idempotent."""
        self._writer.shutdown(wait=True)
        if self._file is not None:
            self._file.close()
            self._file = None

    # In the journal's thread.

    def _append(self, fields: Entry) -> None:
        if self._unusable is not None:
            log.error("the journal cannot be written: %s; lost: %s", self._unusable, fields)
            raise OSError(None, self._unusable)
        try:
            file = self._file or self._open()
            data, head = line(self._head, fields)
            with self._as_before_if_it_fails(file):
                _append(file, data + b"\n")
                durable.write(head_file(self.path), msgspec.json.encode(head))
            self._head = head
        except Exception as error:  # whatever it is, who waits is told that nothing was written
            why = getattr(error, "strerror", None) or error
            self.problem = f"{self.path} cannot be written: {why}; make room or correct its rights"
            log.error("the journal: %s; lost: %s", self.problem, fields)
            raise OSError(getattr(error, "errno", None), self.problem) from error
        self.problem = None

    @contextlib.contextmanager
    def _as_before_if_it_fails(self, file: BinaryIO) -> Iterator[None]:
        """An entry that is reported lost stands neither in the journal nor in its head."""
        size = file.seek(0, os.SEEK_END)
        try:
            yield
        except Exception:
            self._file = None  # whatever is there now, the next entry follows it
            with contextlib.suppress(OSError), file:
                os.ftruncate(file.fileno(), size)
                os.fsync(file.fileno())
                durable.write(head_file(self.path), msgspec.json.encode(self._head))
            raise

    def _open(self) -> BinaryIO:
        """Open it behind its last whole line; what a crash has left half-written is cut off and said."""
        file = self.path.open("a+b", buffering=0)
        try:
            said = self._take_up(file)
            durable.sync_folder(self.path.parent)
        except BaseException:
            file.close()
            raise
        self._file = file
        if said is not None:
            log.warning("the journal %s: %s", self.path, said)
            self._append(
                {"utc_ns": time.time_ns(), "who": "gateway", "what": "journal damaged", "result": said}
            )
        return file

    def _take_up(self, file: BinaryIO) -> str | None:
        """Find the newest entry; says what is wrong with the journal's end."""
        end = _end_of_last_line(file)
        torn = file.seek(0, os.SEEK_END) - end
        if torn:
            os.ftruncate(file.fileno(), end)
        last = _last_lines(file, 1)
        try:
            self._head = check(0, None, last[0])[0] if last else Head()
            known = read_head(self.path)
        except Broken as error:
            return self._set_aside(file, str(error))
        if known is not None and known.n > self._head.n:
            return f"{known.n - self._head.n} entries are missing at its end"
        return f"its last entry was cut by a crash: {torn} bytes were removed" if torn else None

    def _set_aside(self, file: BinaryIO, why: str) -> str:
        """Nothing can follow what does not hold: begin anew, and keep the old one to be looked at."""
        kept = self.path.with_name(f"{self.path.name}.broken-{time.time_ns()}")
        kept.write_bytes(self.path.read_bytes())
        os.ftruncate(file.fileno(), 0)
        self._head = Head()
        return f"{why}; the journal begins anew, the old one is {kept.name}"

    def _tail(self, count: int) -> list[Entry]:
        if self._unusable is not None:
            raise OSError(None, self._unusable)
        file = self._file or self._open()
        try:
            return [msgspec.json.decode(one, type=Entry) for one in _last_lines(file, count)]
        except UNDECODABLE as error:
            raise OSError(None, f"{self.path} is damaged: {error}") from error


def _append(file: BinaryIO, data: bytes) -> None:
    """Append and make durable."""
    written = file.write(data)
    if written != len(data):
        raise OSError(None, f"only {written} of {len(data)} bytes could be written")
    os.fsync(file.fileno())


def _end_of_last_line(file: BinaryIO) -> int:
    end = file.seek(0, os.SEEK_END)
    while end:
        begin = max(0, end - _TAIL_BYTES)
        file.seek(begin)
        found = file.read(end - begin).rfind(b"\n")
        if found >= 0:
            return begin + found + 1
        end = begin
    return 0


def _last_lines(file: BinaryIO, count: int) -> list[bytes]:
    """The last whole lines, oldest first."""
    begin = _end_of_last_line(file)
    data = b""
    while begin and data.count(b"\n") <= count:
        step = min(begin, _TAIL_BYTES)
        begin -= step
        file.seek(begin)
        data = file.read(step) + data
    return data.split(b"\n")[:-1][-count:]
