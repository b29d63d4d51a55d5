"""The uploader: a thread that brings frozen segments into the store, again and again until they are there."""

import contextlib
import logging
import sqlite3
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final, Self

from gateway.amounts import counted
from gateway.client.backoff import Backoff
from ml.store.errors import StoreError, StoreRefused, StoreUnreachable
from ml.store.store import Store
from server_gui.core.recording.compaction import Compaction
from server_gui.core.recording.errors import Damaged, RecordingError
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import ahead, lost_batches, send
from server_gui.core.threads.supervision import Worker

log = logging.getLogger(__name__)

KNOWN: Final = (StoreError, RecordingError, sqlite3.Error)
LOOK_S: Final = 1.0  # between looks at the spool
UPLOAD_S: Final = 600.0  # one batch takes so long at most, with a pause before it
LONGEST_S: Final = 60.0  # between attempts on a store that cannot be reached


@dataclass(frozen=True, slots=True)
class UploaderState:
    """State of uploading; `problem` is the reason of a failure, and ends with the next success."""

    uploaded: int = 0  # segments since the start
    waiting: int = 0  # segments that are frozen and not in the store
    backlog_bytes: int = 0  # with the rows that are being written, which are no batch yet
    upload_s: float = 0.0  # how long the newest one took
    problem: str | None = None
    damaged: tuple[str, ...] = ()  # files that were set aside: their rows are not in the store
    lost: tuple[str, ...] = ()  # in words: batches that are lost as a whole, a store that is no more, damage
    ahead: tuple[str, ...] = ()  # where the store has what this spool has lost, in words


class Uploader:
    """Empties a spool into a store; use it as a context manager, which joins its thread.

    `wanted` is asked before each segment: uploading may wait for a quiet hour, or for `now`. The store is
    made by `connect` in the uploader's thread, and anew after whatever went wrong. Where it is `compacting`,
    that too begins when it is wanted and nothing waits.
    """

    def __init__(
        self,
        spool: Spool,
        connect: Callable[[], Store],
        wanted: Callable[[], bool] = lambda: True,
        compacting: Compaction | None = None,
    ) -> None:
        self.state = UploaderState(lost=(spool.missing,) if spool.missing else ())
        self._spool = spool
        self._connect = connect
        self._wanted = wanted
        self._compacting = compacting
        self._store: Store | None = None
        self._left: list[str] = []  # what could not be done this time, and kept nothing else from being done
        self._compared = False  # whether the store is ahead of the spool
        self._ending = threading.Event()
        self._asked = threading.Event()
        self._hurries = threading.Event()
        self._turned = threading.Event()  # it has looked at everything that waits
        self.worker = Worker("uploader", self._run, UPLOAD_S)

    def __enter__(self) -> Self:
        self.worker.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self, within_s: float | None = None) -> bool:
        """End after the segment that is being uploaded, and join the thread. Idempotent.

        False where that takes longer than `within_s`; the thread goes on then, and nothing is uploaded twice
        however it ends.
        """
        self._ending.set()
        self._asked.set()
        return self.worker.join(within_s)

    def drain(self, within_s: float) -> bool:
        """Upload everything that waits, wanted or not; False where it fails, takes longer, or is hurried."""
        until_s = time.monotonic() + within_s
        while self._spool.waiting():
            self._turned.clear()
            if self._hurries.is_set():
                return False
            self.now()
            if not self._turned.wait(max(0.0, until_s - time.monotonic())) or self.state.problem is not None:
                return False
        return True

    def hurry(self) -> None:
        """End the wait for a `drain`, from any thread: what is in the spool stays there."""
        self._hurries.set()
        self._turned.set()

    def now(self) -> None:
        """Upload everything that waits, wanted or not."""
        self._asked.set()

    def look(self) -> UploaderState:
        """Return the state with what waits at this instant, from any thread: an attempt may be a minute ago.

        Raises:
            SpoolUnusable: what waits is not known.

        """
        return self._with_backlog(self.state)

    # --- the uploader's thread

    def _run(self) -> None:
        backoff = Backoff(LOOK_S, LONGEST_S)
        asked = False
        while not self._ending.is_set():
            if self._asked.is_set():  # what is asked from here on stays for the next time
                self._asked.clear()
                asked = True
            if self._empty(asked):
                asked = False
                backoff.reset()
                self._compact()
            self._turned.set()
            self.worker.beat()
            if not self._ending.is_set():  # set before `_asked`, which may have been cleared since
                self._asked.wait(backoff.next_s())
        if self._compacting is not None:
            self._compacting.close()

    def _compact(self) -> None:
        if self._compacting is not None and self.state.uploaded and self._wanted():
            self._compacting.look()

    def _empty(self, asked: bool) -> bool:
        """Upload what waits; False where not all of it could be."""
        self._left = []
        what = "what waits in the spool is not known"
        try:
            waiting = self._tell()
            what = "what is lost is not told in the store yet"
            with self._alone(what):
                self._look(told=asked or self._wanted())
            for number in waiting:
                if self._ending.is_set() or not (asked or self._wanted()):
                    break
                self.worker.beat()
                what = f"batch {number} is not in the store yet"
                store = self._store = self._store or self._reach()
                with self._alone(what):
                    self._upload(number, store)
                self._tell()
        except Exception as error:  # noqa: BLE001 - uploading goes on, whatever a library raises
            return self._failed(what, error)
        if self._left:
            log.warning("%s", self._problem)
        return not self._left

    @contextlib.contextmanager
    def _alone(self, what: str) -> Iterator[None]:
        """Keep the problem of one batch from the others."""
        try:
            yield
        except (StoreUnreachable, StoreRefused):
            raise
        except (RecordingError, sqlite3.Error):
            raise
        except Exception as error:  # noqa: BLE001 - as where a file of the table is gone that this one is in
            self._store = None
            self._left.append(f"{what}: {_told(error)}")
            self.state = replace(self.state, problem=self._problem)

    @property
    def _problem(self) -> str | None:
        """The failure of this attempt, in words."""
        if not self._left:
            return None
        others = len(self._left) - 1
        return self._left[0] + (f" (and {counted(others, 'other')} likewise)" if others else "")

    def _look(self, *, told: bool) -> None:
        """Alarm for batches that are lost as a whole, and have them `told` in the store."""
        lost = self._spool.untold()
        self._alarm((*lost.values(), *self._spool.notices))
        if lost and told:
            self._store = self._store or self._reach()
            lost_batches(self._spool, self._store)
            self.state = replace(self.state, problem=self._problem)

    def _alarm(self, texts: Iterable[str]) -> None:
        for text in texts:
            if text not in self.state.lost:
                log.error("%s", text)
                self.state = replace(self.state, lost=(*self.state.lost, text))

    def _failed(self, what: str, error: Exception) -> bool:
        self._store = None
        problem = _told(error)
        log.warning("%s: %s", what, problem)
        self.state = replace(self.state, problem=problem)
        return False

    def _upload(self, number: int, store: Store) -> None:
        began_s = time.monotonic()
        try:
            send(self._spool, number, store)
        except Damaged as error:
            log.error("batch %d is not uploaded as a whole: %s", number, error)
            return
        finally:
            self._alarm(self._spool.notices)
        took_s, uploaded = time.monotonic() - began_s, self.state.uploaded + 1
        self.state = replace(self.state, uploaded=uploaded, upload_s=took_s, problem=self._problem)
        log.info("batch %d is in the store after %.1f s", number, took_s)

    def _reach(self) -> Store:
        store = self._connect()
        if not self._compared:
            try:
                self._compare(store)
            except StoreError as error:  # what it keeps from being uploaded tells that itself
                log.warning("the store is not compared with the spool yet: %s", error)
        return store

    def _compare(self, store: Store) -> None:
        found = tuple(ahead(self._spool, store))
        for text in found:
            log.error("%s", text)
        self.state = replace(self.state, ahead=found)
        self._compared = True

    def _tell(self) -> list[int]:
        """Update the backlog, and return the pending batches."""
        damaged = tuple(map(str, self._spool.damaged()))
        self.state = replace(self._with_backlog(self.state), damaged=damaged)
        return self._spool.waiting()

    def _with_backlog(self, state: UploaderState) -> UploaderState:
        waiting, backlog = len(self._spool.waiting()), self._spool.backlog_bytes()
        return replace(state, waiting=waiting, backlog_bytes=backlog)


def _told(error: Exception) -> str:
    if isinstance(error, KNOWN):
        return str(error)
    return f"internal error, {type(error).__name__}"  # its text may quote keys
