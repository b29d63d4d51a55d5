"""Whether the machine itself stood still: how late an ordinary thread of an ordinary process is woken up."""

import threading
import time

PERIOD_S = 0.01
BUSY_MS = 100.0  # beyond that, what was measured is not the attack's doing alone


class Stalls:
    """Looks from `start` to `stop`, which tells the longest lateness in ms."""

    def __init__(self) -> None:
        self._worst_ms = 0.0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._look, name="stalls of the machine")

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> float:
        self._ending.set()
        self._thread.join()
        return self._worst_ms

    def _look(self) -> None:
        before = time.monotonic()
        while not self._ending.wait(PERIOD_S):
            now = time.monotonic()
            self._worst_ms = max(self._worst_ms, 1e3 * (now - before - PERIOD_S))
            before = now
