"""The load of this computer, as far as Linux tells it; unknown is not overloaded."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from server_gui.core.follow.missing_pdos import BUSY_PERCENT

EVERY_S: Final = 1.0  # between readings
OLD_S: Final = 10.0  # a reading before says nothing of now
FULL_PERCENT: Final = 95.0  # of its time: there is no room left
HELD_S: Final = 3.0  # that it is full before it is called busy
LASTS_S: Final = 5.0  # that it is called overloaded after its last busy second, so that no words flicker
TIMES: Final = 8  # of the first line of /proc/stat, without those of guests, which are in it already
IDLE: Final = (3, 4)  # idle, and waiting for a disk


def read_stat() -> str:
    """Return the times of all cores together."""
    with Path("/proc/stat").open(encoding="ascii") as file:
        return file.readline()


class OwnLoad:
    """Whether the cores of this computer are busy; asked in each frame, it reads once a second."""

    def __init__(
        self, read: Callable[[], str] = read_stat, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._read = read
        self._now_s = now_s
        self._at_s = float("-inf")
        self._times: tuple[int, int] | None = None  # idle, all
        self._busy_s = float("-inf")  # when it was busy the last time
        self._full_since_s: float | None = None  # None: the newest reading was not full
        self._is_full = False

    def is_overloaded(self) -> bool:
        """Return whether at least nine tenths of its time were taken within the last seconds."""
        return self._look_again() - self._busy_s <= LASTS_S

    def is_full(self) -> bool:
        """Return whether it was full for some seconds; so until it is not overloaded any more."""
        now_s = self._look_again()
        if self._full_since_s is not None and now_s - self._full_since_s >= HELD_S:
            self._is_full = True
        elif now_s - self._busy_s > LASTS_S:
            self._is_full = False
        return self._is_full

    def _look_again(self) -> float:
        """Read where it is time; the instant."""
        now_s = self._now_s()
        if now_s - self._at_s >= EVERY_S:
            before, self._times = self._times, self._look()
            percent = self._percent(before) if now_s - self._at_s <= OLD_S else 0.0
            if percent >= BUSY_PERCENT:
                self._busy_s = now_s
            if percent < FULL_PERCENT:
                self._full_since_s = None
            elif self._full_since_s is None:
                self._full_since_s = self._at_s
            self._at_s = now_s
        return now_s

    def _look(self) -> tuple[int, int] | None:
        try:
            times = [int(word) for word in self._read().split()[1 : 1 + TIMES]]
            return sum(times[place] for place in IDLE), sum(times)
        except (OSError, ValueError, IndexError):
            return None

    def _percent(self, before: tuple[int, int] | None) -> float:
        """Of its time since `before`; 0 where nobody knows."""
        if before is None or self._times is None:
            return 0.0
        idle, every = self._times[0] - before[0], self._times[1] - before[1]
        return 100.0 * (every - idle) / every if every > 0 else 0.0
