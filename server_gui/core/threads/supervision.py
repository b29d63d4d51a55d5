"""The one place that watches over this program's threads: one that dies or stands still is an alarm.

A `Worker` is a thread that says again and again that it moves; `ThreadWatch.look` is called a few times a
second by whoever waits anyway. Each trouble is said once in the log, stays for the screen and the status
command, and goes when it is over.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterable
from typing import Final

from msgspec import Struct

log = logging.getLogger(__name__)

BEAT_S: Final = 0.25  # within which a thread that has nothing to do says so
STILL_S: Final = 0.75  # without a word it stands still, where its work is never as long
LATE_S: Final = 5.0  # beyond that it is late; then it hangs
AGAIN_S: Final = 1.0  # between beginnings of a thread that dies again and again
HELD_S: Final = 60.0  # that a death stays an alarm after the thread was begun anew, so that it is seen


class Trouble(Struct, frozen=True):
    """Trouble of a thread; `works` is whether its task continues all the same.

    One that `is_late` has stood still for a moment only, as on a computer that is busy.
    """

    thread: str
    text: str
    works: bool
    is_late: bool = False


class Worker:
    """A thread with an owner, which joins it. `run` returns when its owner has asked for that, not before.

    `still_s` is how long it may work without a `beat`. Where it dies, `run` is begun anew.
    """

    def __init__(
        self,
        name: str,
        run: Callable[[], None],
        still_s: float = STILL_S,
        *,
        daemon: bool = False,
    ) -> None:
        self.name = name
        self._run = run
        self._still_s = still_s
        self._daemon = daemon
        self._lock = threading.Lock()  # so that nothing is begun anew while its owner leaves
        self._thread: threading.Thread | None = None
        self._leaving = False
        self._beat_s = 0.0
        self._cause = ""
        self._deaths = 0
        self._died_s = 0.0  # the last time
        self._began_s = 0.0

    def start(self) -> None:
        """Begin."""
        self._began_s = self._beat_s = time.monotonic()
        self._thread = threading.Thread(target=self._guarded, name=self.name, daemon=self._daemon)
        self._thread.start()

    def beat(self) -> None:
        """Note that it is alive; from the thread itself."""
        self._beat_s = time.monotonic()

    def join(self, within_s: float | None = None) -> bool:
        """Wait for its end, which its owner has asked for; False where it takes longer. Idempotent."""
        with self._lock:
            self._leaving = True
        if self._thread is not None:
            self._thread.join(within_s)
        return not self.is_alive()

    def is_alive(self) -> bool:
        """Return whether it runs."""
        return self._thread is not None and self._thread.is_alive()

    def look(self) -> Trouble | None:
        """Return its present trouble; restart it if it has died."""
        with self._lock:
            return self._look(time.monotonic())

    def _look(self, now_s: float) -> Trouble | None:
        if self._thread is None or self._leaving:
            return None
        if not self._thread.is_alive():
            if self._died_s < self._began_s:
                self._deaths, self._died_s = self._deaths + 1, now_s
            if self._deaths > 1 and now_s - self._began_s < AGAIN_S:
                text = f"the part “{self.name}” stopped unexpectedly, and stops again {self._why}"
                return Trouble(self.name, text, works=False)
            self.start()
        if (still_s := now_s - self._beat_s) > self._still_s:
            still = f"the part “{self.name}” has not moved for more than {self._still_s:g} s"
            late = still_s < self._still_s + LATE_S
            return Trouble(self.name, f"{still}; is this computer too busy?", works=False, is_late=late)
        if self._deaths and now_s - self._died_s < HELD_S:
            text = f"the part “{self.name}” stopped unexpectedly and was restarted {self._why}"
            return Trouble(self.name, text, works=True)
        return None

    @property
    def _why(self) -> str:
        times = "once" if self._deaths == 1 else f"{self._deaths} times"
        cause = f"{self._cause}; " if self._cause else ""
        return f"({cause}{times} so far); see the log"

    def _guarded(self) -> None:
        try:
            self._run()
            self._cause = ""  # it returned unasked
        except BaseException as error:  # nothing may end a thread without a word
            self._cause = type(error).__name__
            log.exception("the thread %s has died", self.name)


class ThreadWatch:
    """Looks after workers; `look` may be called from any thread, and as often as one likes."""

    def __init__(self, workers: Iterable[Worker]) -> None:
        self._workers = tuple(workers)
        self._lock = threading.Lock()
        self._known: dict[str, Trouble] = {}

    def add(self, worker: Worker) -> None:
        """Watch another one from now on."""
        with self._lock:
            self._workers += (worker,)

    def look(self) -> tuple[Trouble, ...]:
        """Return all present trouble; log its begin and end."""
        with self._lock:
            found = {worker.name: trouble for worker in self._workers if (trouble := worker.look())}
            for name, trouble in found.items():
                if self._known.get(name) != trouble:
                    log.error("%s", trouble.text)
            for name in self._known.keys() - found.keys():
                log.warning("no longer: %s", self._known[name].text)
            self._known = found
            return tuple(found.values())
