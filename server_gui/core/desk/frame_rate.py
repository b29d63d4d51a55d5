"""How often the window is drawn: where that is seldom, all that is shown is late."""

import collections
import time
from typing import Final

KEPT: Final = 60  # frames that are averaged
LEAST: Final = 5  # before which no rate is known
SETTLES_S: Final = 4.0  # a window that opens is slow, whatever else this computer does
SLOW: Final = 8.0  # frames a second, below which this computer is busy, whatever else it does
FAST: Final = 10.0  # from which it is not any more, so that no words flicker


class FrameRate:
    """Counts the frames that were drawn."""

    def __init__(self) -> None:
        self._drawn_s: collections.deque[float] = collections.deque(maxlen=KEPT)
        self._since_s: float | None = None  # when the first was drawn
        self._is_slow = False

    def count(self, now_s: float | None = None) -> None:
        """Count one that is drawn, at an instant of our monotonic clock."""
        now_s = time.monotonic() if now_s is None else now_s
        self._since_s = now_s if self._since_s is None else self._since_s
        self._drawn_s.append(now_s)
        rate, is_settled = self.per_second, now_s - self._since_s >= SETTLES_S
        self._is_slow = is_settled and rate is not None and rate < (FAST if self._is_slow else SLOW)

    @property
    def per_second(self) -> float | None:
        """The rate of late; None while too few are known."""
        if len(self._drawn_s) < LEAST:
            return None
        return (len(self._drawn_s) - 1) / max(self._drawn_s[-1] - self._drawn_s[0], 1e-6)

    def is_slow(self) -> bool:
        """Return whether so few are drawn that this computer cannot keep up."""
        return self._is_slow
