"""The stop's own thread: it asks drives and controllers to stop and watches over a held stop.

No client's work, and no disk, stands between a stop and the bus: the gateway's loop only tells of it.
"""

import logging
import queue
import threading
import time
from collections.abc import Callable

from drivers.inbox import Inbox
from drivers.realtime_priority import make_realtime
from gateway.process.memory import MemoryLock

log = logging.getLogger(__name__)

Work = Callable[[], object]


class StopThreadEnded(Exception):
    """Too late: the module that carries out stops is ending."""


class StopThread:
    """Does what it is given, in order; and `look` every `period_s` while `watches` says so."""

    def __init__(self, look: Work, watches: Callable[[], bool], period_s: float) -> None:
        self._look = look
        self._watches = watches
        self._period_s = period_s
        self._due: float | None = None  # when to look next; `None` while there is nothing to watch
        self._work: Inbox[Work | None] = Inbox()
        self._closed = False
        self._closing = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="stop", daemon=True)

    def start(self) -> None:
        MemoryLock.begin()
        self._thread.start()

    def close(self) -> None:
        """Finish the given work, and end."""
        with self._closing:
            self._closed = True
            self._work.put(None)
        self._thread.join()
        MemoryLock.end()

    def put(self, work: Work) -> None:
        """Do it as soon as can be; from any thread, never waits.

        Raises:
            Ended: the thread is closed, and nothing was done.

        """
        with self._closing:
            if self._closed:
                raise StopThreadEnded("the stop's thread has ended; ask again")
            self._work.put(work)

    def _run(self) -> None:
        make_realtime()
        while (work := self._next()) is not None:
            try:
                work()
            except Exception:  # a stop must be possible after whatever went wrong
                log.exception("the stop's thread failed")

    def _next(self) -> Work | None:
        if not self._watches():
            self._due = None
            return self._work.get()
        self._due = self._due or time.monotonic() + self._period_s
        try:
            return self._work.get(timeout=max(0.0, self._due - time.monotonic()))
        except queue.Empty:
            self._due = None
            return self._look
