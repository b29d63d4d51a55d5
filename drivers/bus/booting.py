"""Boot-up of a node: attempts in its worker's thread, one at a time, with growing pauses.

What happens meanwhile (the node reboots, its bus goes, a user comes) makes an attempt worthless: the
generation counts on, and only an attempt of the latest one makes the node ready.
"""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future

from drivers.bus.sdo.channel import Interrupted, SdoChannel
from drivers.bus.sdo.worker import SdoWorker
from drivers.errors import DriverError

FIRST_RETRY_S = 0.1  # also how long the first attempt waits: a cold start must not hang on one lost frame
LAST_RETRY_S = 2.0
_COMING_UP = "it was not read yet: look again in a moment"


class Booting:
    """The attempts of one node. `lock` is the node's: what it knows of itself changes with the generation."""

    def __init__(
        self,
        worker: SdoWorker,
        lock: threading.RLock,
        come_up: Callable[[SdoChannel], None],
        explain: Callable[[DriverError], str],
    ) -> None:
        self.ready = False
        self.step = _COMING_UP  # where it is stuck, in words
        self.begun = 0  # attempts
        self.retry_s = FIRST_RETRY_S
        self._worker = worker
        self._lock = lock
        self._come_up = come_up
        self._explain = explain
        self._retry_ns = 0
        self._generation = 0  # counts what makes an earlier boot worthless
        self._booted_generation = 0  # of the boot that is under way, or was the last
        self._booting: Future[None] | None = None

    @property
    def comes_up(self) -> bool:
        """Whether an attempt is under way, and none since it began anew has failed."""
        attempt = self._booting
        return attempt is not None and not attempt.done() and self.step is _COMING_UP

    def overtake(self) -> None:
        """Invalidate a boot that is under way: it does not know all that it should."""
        with self._lock:
            self._generation += 1
            self.ready = False

    def begin_anew(self) -> None:
        """Nothing is known of the node: the next attempt may come at once."""
        with self._lock:
            self.overtake()
            self.step = _COMING_UP
            self.retry_s, self._retry_ns = FIRST_RETRY_S, 0

    def hurry(self) -> None:
        """Note that the node is there: try at the next `retry`."""
        if not self.ready:
            self._retry_ns = 0

    def retry(self, now_ns: int) -> None:
        """Try again where it is time to."""
        if not self.ready and now_ns >= self._retry_ns:
            self.start()

    def start(self) -> None:
        """Try now, unless an attempt is under way."""
        with self._lock:
            if self._booting is None or self._booting.done():
                self._retry_ns = time.monotonic_ns() + round(self.retry_s * 1e9)
                self._booting = self._worker.submit(self._boot, current=self.is_current)

    def is_current(self) -> bool:
        """Return whether nothing has overtaken the attempt that is under way."""
        return self._booted_generation == self._generation

    def _boot(self, sdo: SdoChannel) -> None:
        self.begun += 1
        self._booted_generation = self._generation
        try:
            self._come_up(sdo)
        except DriverError as error:
            self._try_later(self._explain(error))
        except Interrupted:
            raise
        except Exception as error:  # noqa: BLE001 - it must be told, and not be tried without a pause
            self._try_later(f"internal error: {type(error).__name__}: {error}")
        else:
            with self._lock:
                self.ready = self.is_current()
                self.retry_s, self._retry_ns = FIRST_RETRY_S, 0

    def _try_later(self, step: str) -> None:
        with self._lock:
            if not self.is_current():
                self._retry_ns = 0
                return
            self.step = step
            self._retry_ns = time.monotonic_ns() + round(self.retry_s * 1e9)
            self.retry_s = min(2 * self.retry_s, LAST_RETRY_S)
