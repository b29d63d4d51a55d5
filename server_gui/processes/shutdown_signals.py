"""Ctrl-C, SIGTERM and a closed terminal as something that is asked, and noticed between two steps."""

import signal
from types import FrameType, TracebackType
from typing import Any, Self

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")  # the last not on Windows
SIGNALS = tuple(number for name in _NAMES if (number := getattr(signal, name, None)) is not None)


class ShutdownRequested(Exception):
    """Somebody asked us to end; `status` is the exit status that says how."""

    def __init__(self, number: int) -> None:
        super().__init__(f"ended by {signal.Signals(number).name}")
        self.status = 128 + number


class ShutdownSignals:
    """While inside, `SIGNALS` are only noted; `check` raises once one came. For the main thread."""

    def __init__(self) -> None:
        self._asked: int | None = None
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for number in SIGNALS:
            self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)

    def check(self) -> None:
        """Check for a signal; raises `ShutdownRequested`."""
        if self._asked is not None:
            raise ShutdownRequested(self._asked)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self._asked = number
