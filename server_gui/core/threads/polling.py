"""A thread that looks somewhere again and again, and that nobody waits for without end."""

import threading
from collections.abc import Callable
from typing import Final, Self

from server_gui.core.threads.supervision import Worker

LOOK_S: Final = 600.0  # a look takes less


class Looking:
    """Calls `look` at once, then every `every_s` and after each `wake`; use it as a context manager.

    What hangs in a look holds leaving up for no longer than `break_off_s`; then it ends with the process.
    """

    def __init__(self, name: str, look: Callable[[], None], every_s: float, break_off_s: float) -> None:
        self.ending = False
        self._look = look
        self._every_s = every_s
        self._break_off_s = break_off_s
        self._wake = threading.Event()
        self.worker = Worker(name, self._run, LOOK_S + every_s, daemon=True)

    def __enter__(self) -> Self:
        self.worker.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.ending = True
        self._wake.set()
        self.worker.join(self._break_off_s)

    def wake(self) -> None:
        """Look now; from any thread."""
        self._wake.set()

    def _run(self) -> None:
        while not self.ending:
            self.worker.beat()
            self._look()
            self._wake.wait(self._every_s)
            self._wake.clear()
