"""The record of a held stop: written when a stop is held, removed by its reset, found by the next gateway."""

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import msgspec

from gateway.process.boot import boot_id
from gateway.records import durable
from gateway.records.chain import UNDECODABLE

log = logging.getLogger(__name__)

Wrote = Callable[["HeldStop", str | None], "Future[None]"]


class HeldStop(msgspec.Struct, frozen=True):
    """A stop that is held: who asked for it and why, and when, on the clock of which boot."""

    who: str
    reason: str
    utc_ns: int
    monotonic_ns: int
    boot_id: str


class HoldFile:
    """Its own thread writes, so that no disk delays a stop. At most one stop is held; for any thread.

    `wrote(held, problem)` is told when a record is on the disk, or why it is not; it writes that down.
    """

    def __init__(self, path: Path, unusable: str | None, wrote: Wrote) -> None:
        self.held: HeldStop | None = None
        self.problem: str | None = None  # why it will not outlive this gateway, as far as that is known
        self.kept: Future[str | None] | None = None  # that, once it is known of the newest
        self._path = path
        self._unusable = unusable
        self._wrote = wrote
        self._waiting: Future[str | None] | None = None  # for the disk to turn to it
        self._overtaken: dict[str, HeldStop] = {}  # whose stop another's has replaced meanwhile
        self._lock = threading.Lock()
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="hold")

    def load(self) -> HeldStop | None:
        """Take up what the last gateway left; a file that cannot be read is a held stop of unknown reason."""
        try:
            self.held = msgspec.json.decode(self._path.read_bytes(), type=HeldStop)
        except (FileNotFoundError, NotADirectoryError) as error:
            self.held = self._unreadable(error) if self._path.is_symlink() else None
        except (OSError, *UNDECODABLE) as error:
            self.held = self._unreadable(error)
        return self.held

    def _unreadable(self, error: Exception) -> HeldStop:
        log.error("%s cannot be read (%s): the stop is held", self._path, error)
        return HeldStop("unknown", f"{self._path.name} cannot be read: {error}", 0, 0, "")

    def write(self, who: str, reason: str) -> None:
        """Keep it: a second stop is the same one, for another reason.

        Those that come before the disk has turned to the last one are written at once; `wrote` is told each
        of those who asked.
        """
        now = HeldStop(who, reason, time.time_ns(), time.monotonic_ns(), boot_id())
        with self._lock:
            before = self.held
            if before is not None and self._waiting is not None:
                self._overtaken[before.who] = before
            self.held = now if before is None else msgspec.structs.replace(before, who=who, reason=reason)
            if self._waiting is None:
                kept = self.kept = self._waiting = Future()
                self._writer.submit(self._write_newest, kept)

    def write_again(self) -> None:
        """Keep on what was to be removed, and could not be as a whole."""
        with self._lock:
            held = self.held
        if held is not None:
            self._writer.submit(self._keep, held)

    def remove(self) -> "Future[None]":
        """Keep it no longer; fails with `OSError`."""
        with self._lock:
            self._waiting = None  # what is held from now on is written behind this
            return self._writer.submit(self._remove)

    def forget(self) -> None:
        """Nothing is held any more."""
        with self._lock:
            self.held = self.kept = self.problem = None

    def close(self) -> None:
        """Finish the pending writes, and end."""
        self._writer.shutdown(wait=True)

    def _write_newest(self, kept: "Future[str | None]") -> None:
        with self._lock:
            held, overtaken, self._overtaken = self.held, self._overtaken, {}
            if self._waiting is kept:
                self._waiting = None
        if held is None:  # it was reset before its turn came
            kept.set_result(None)
            return
        self._keep(held)
        problem = self.problem
        for one in overtaken.values():
            if one.who != held.who:
                self._wrote(one, problem)
        self._wrote(held, problem).add_done_callback(lambda _written: kept.set_result(problem))

    def _keep(self, held: HeldStop) -> None:
        try:
            self._write(msgspec.json.encode(held))
        except OSError as error:
            self.problem = f"this stop is held, but not beyond this gateway: {error.strerror or error}"
        else:
            self.problem = None

    def _write(self, data: bytes) -> None:
        if self._unusable is not None:
            raise OSError(None, self._unusable)
        durable.write(self._path, data)

    def _remove(self) -> None:
        """Remove the record, unless the folder belongs to another gateway."""
        if self._unusable is None:
            durable.remove(self._path)
