"""The shutdown of the window: its parts one after another, each with a time limit."""

import concurrent.futures
import threading
import time
from collections.abc import Callable
from typing import Final

from server_gui.core.desk.feeds import Feeds

BREAK_OFF_S: Final = 5.0  # for what is read from the store at the end
SLICE_S: Final = 0.1  # between two looks whether anybody wants to wait


class Shutdown:
    """`begin` ends all in a thread, `wait` waits for that, `finish` joins it, or ends all in this thread.

    `close_others` has so many seconds for what may hang, and says whether it ended; `close_last` comes after
    the recording, so that nobody misses what it ends.
    """

    def __init__(
        self, feeds: Feeds, close_others: Callable[[float], bool], close_last: Callable[[], None]
    ) -> None:
        self._feeds = feeds
        self._close_others, self._close_last = close_others, close_last
        self._others_ended = True
        self._hurries = threading.Event()
        self._waits_for = ""
        self._thread: concurrent.futures.ThreadPoolExecutor | None = None
        self._done: concurrent.futures.Future[None] | None = None

    @property
    def waits_for(self) -> str:
        """What is not over yet, in words."""
        return self._waits_for or self._feeds.ends

    @property
    def is_begun(self) -> bool:
        """Whether it ends already."""
        return self._done is not None

    @property
    def is_hurried(self) -> bool:
        """Whether nobody wants to wait."""
        return self._hurries.is_set()

    def wait(self, within_s: float) -> bool:
        """Wait so long for the end that was begun; whether it is over."""
        if self._done is not None:
            concurrent.futures.wait([self._done], within_s)
        return self.is_over

    @property
    def is_over(self) -> bool:
        """Whether everything has ended that was begun to end."""
        return self._done is None or self._done.done()

    @property
    def hangs(self) -> bool:
        """Whether something still runs, which only the end of the process ends."""
        return not self.is_over or not self._others_ended or self._feeds.hangs

    def begin(self) -> None:
        """End everything in a thread."""
        self._thread = concurrent.futures.ThreadPoolExecutor(1, "ending")
        self._done = self._thread.submit(self._end)

    def hurry(self) -> None:
        """Wait for nothing but what goes to the disk; from any thread."""
        self._hurries.set()
        self._feeds.hurry()

    def finish(self) -> None:
        """Raise the error of an ending part, if any; abandon one that does not end in time."""
        if self._done is None:
            self._end()
        elif self._done.done() or not self._hurries.is_set():
            self._done.result()
        if self._thread is not None and self.is_over:
            self._thread.shutdown()

    def _end(self) -> None:
        self._waits_for = "what is asked of store and simulator is broken off"
        until_s = time.monotonic() + BREAK_OFF_S
        while not (ended := self._close_others(SLICE_S)) and time.monotonic() < until_s:
            if self._hurries.is_set():
                break
        self._others_ended, self._waits_for = ended, ""
        try:
            self._feeds.__exit__()
        finally:
            self._waits_for = "the simulated robot ends"
            self._close_last()
