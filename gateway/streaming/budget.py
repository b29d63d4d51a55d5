"""The share of a core that the gateway may use: beyond it, streams give way, and nothing else ever does.

They give way too where they cannot keep up, whatever the share: rows that are late by ever more help nobody.
"""

import logging
import math
import time
from collections.abc import Callable

from gateway.process.loop import Loop, Timer
from gateway.wire.messages import BudgetInfo

log = logging.getLogger(__name__)

LOOK_S = 1.0
OVER_LOOKS, UNDER_LOOKS = 2, 5  # in a row, before more or less is shed
MOST = 64  # one row of so many is always sent
LATE_S = 0.25  # streams that are later than this do not keep up
_UNDER = 0.45  # of the most: twice the rows would still be within
_IN_TIME_S = 0.05


class Budget:
    """Looks at the process's own CPU while there are streams; `factor` n means: one row of n is sent.

    `shed` is called with each new factor; `late_s` says how late the streams were since it was asked last.
    """

    def __init__(self, loop: Loop, most_percent: float | None) -> None:
        self.most_percent = most_percent
        self.factor = 1
        self.shed: Callable[[int], None] = lambda _factor: None
        self.late_s: Callable[[], float] = lambda: 0.0
        self._loop = loop
        self._timer: Timer | None = None
        self._looked_ns = self._cpu_ns = self._over = self._under = 0

    @property
    def info(self) -> BudgetInfo | None:
        """As clients are told."""
        return None if self.most_percent is None else BudgetInfo(self.most_percent, self.factor)

    def watch(self, *, on: bool) -> None:
        """Begin, or end; idempotent."""
        if on and self._timer is None:
            self._remember()
            self._timer = self._loop.call_later(LOOK_S, self._look)
        elif not on and self._timer is not None:
            self._timer.cancel()
            self._timer = None
            self.factor, self._over, self._under = 1, 0, 0

    def judge(self, percent: float, late_s: float = 0.0) -> None:
        """Shed twice as much, or half, when that was too much, or little enough, for a while."""
        most = math.inf if self.most_percent is None else self.most_percent
        over, under = percent > most or late_s > LATE_S, percent < _UNDER * most and late_s < _IN_TIME_S
        self._over = self._over + 1 if over else 0
        self._under = self._under + 1 if under else 0
        why = f"are {late_s:.2f} s late" if late_s > LATE_S else f"take {percent:.1f} % of a core in all"
        if self._over == OVER_LOOKS and self.factor < MOST:
            self._set(2 * self.factor, why)
        elif self._under == UNDER_LOOKS and self.factor > 1:
            self._set(self.factor // 2, why)

    def _set(self, factor: int, why: str) -> None:
        self.factor, self._over, self._under = factor, 0, 0
        log.warning("streams %s: they now send one row of %d", why, factor)
        self.shed(factor)

    def _look(self) -> None:
        looked_ns, cpu_ns = self._looked_ns, self._cpu_ns
        self._remember()
        self.judge(100 * (self._cpu_ns - cpu_ns) / (self._looked_ns - looked_ns), self.late_s())
        self._timer = self._loop.call_later(LOOK_S, self._look)

    def _remember(self) -> None:
        self._looked_ns, self._cpu_ns = time.monotonic_ns(), time.process_time_ns()
