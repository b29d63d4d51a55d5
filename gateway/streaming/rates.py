"""Counters' rates since the same asker's last look."""

from collections.abc import Hashable


class Rates:
    """One asker's view of any counters."""

    def __init__(self) -> None:
        self._before: dict[Hashable, float] = {}
        self._now: dict[Hashable, float] = {}
        self._looked_ns = 0
        self._elapsed_s = 0.0

    def look(self, now_ns: int) -> None:
        """Begin another look; what was not asked for in the last is forgotten."""
        self._before, self._now = self._now, {}
        self._elapsed_s, self._looked_ns = (now_ns - self._looked_ns) / 1e9, now_ns

    def __call__(self, counter: Hashable, value: float) -> float | None:
        """Return its rate a second; `None` where it is new."""
        self._now[counter] = value
        before = self._before.get(counter)
        return None if before is None or self._elapsed_s <= 0 else (value - before) / self._elapsed_s

    def rounded(self, counter: Hashable, value: float | None) -> float | None:
        """Return the same to a tenth; a counter that cannot be read has none."""
        rate = None if value is None else self(counter, value)
        return None if rate is None else round(rate, 1)

    def percent(self, counter: Hashable, spent_ns: int) -> float | None:
        """Return a counter of nanoseconds as a share of the time."""
        rate = self(counter, spent_ns)
        return None if rate is None else round(rate / 1e7, 3)
