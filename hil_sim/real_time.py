"""Check of real time: if the simulator falls behind, it reports this once, and then seldom."""

import time
from collections.abc import Callable

from hil_sim.clock import SECOND_NS
from hil_sim.loop import Loop

_WINDOW_NS = 3 * SECOND_NS
_WINDOWS = 2  # in a row: one alone is a machine that slept, or started a program
_WORTH = 0.05  # of a window that was left out
_AGAIN_NS = 60 * SECOND_NS  # at the earliest
_BUSY = 0.8  # of a core: then it is the simulator itself that is too much, else others take the processor

_LOOKS_LIKE = "Silent drives (SDO time-outs) and missing samples may be only this."


class RealTimeCheck:
    """Looks each turn of `loop`, in its thread; `now_ns` and `cpu_ns` are real time and what was computed."""

    def __init__(
        self,
        loop: Loop,
        say: Callable[[str], None],
        now_ns: Callable[[], int] = time.monotonic_ns,
        cpu_ns: Callable[[], int] = time.process_time_ns,
    ) -> None:
        self._loop = loop
        self._say = say
        self._now_ns, self._cpu_ns = now_ns, cpu_ns
        self._since_ns, self._cpu_since_ns = now_ns(), cpu_ns()
        self._skipped_ns, self._simulated_ns = loop.skipped_ns, loop.clock.now_ns
        self._slow = self._even = 0  # windows in a row
        self._said_ns: int | None = None
        self._is_said = False  # that it is behind, and not yet that it is no more
        if loop.speed is not None:  # as fast as it goes is always fast enough
            loop.each_turn(self.look)

    def look(self) -> None:
        """Judge the window once it is over."""
        now_ns = self._now_ns()
        real_ns = now_ns - self._since_ns
        if real_ns < _WINDOW_NS:
            return
        cpu_ns, skipped_ns, simulated_ns = self._cpu_ns(), self._loop.skipped_ns, self._loop.clock.now_ns
        speed = self._loop.speed or 1.0
        lost = (skipped_ns - self._skipped_ns) / (real_ns * speed)
        went, busy = (simulated_ns - self._simulated_ns) / real_ns, (cpu_ns - self._cpu_since_ns) / real_ns
        self._since_ns, self._cpu_since_ns = now_ns, cpu_ns
        self._skipped_ns, self._simulated_ns = skipped_ns, simulated_ns
        self._judge(now_ns, lost, _words(speed, went, busy, real_ns))

    def _judge(self, now_ns: int, lost: float, words: str) -> None:
        is_slow = lost >= _WORTH
        self._slow, self._even = (self._slow + 1, 0) if is_slow else (0, self._even + 1)
        if self._slow >= _WINDOWS and (self._said_ns is None or now_ns - self._said_ns >= _AGAIN_NS):
            self._said_ns, self._is_said = now_ns, True
            self._say(words)
        elif self._even >= _WINDOWS and self._is_said:
            self._is_said = False
            self._say("it keeps its pace again")


def _words(speed: float, went: float, busy: float, real_ns: int) -> str:
    """Return the slowness and its remedy, in words."""
    pace = "real time" if speed == 1.0 else f"{speed:g} times real time"
    if busy >= _BUSY:
        why = f"it takes {100 * busy:.0f} % of a core itself: take a lower --speed, or a faster computer"
    else:
        why = (
            f"it got only {100 * busy:.0f} % of a core: end other programs (see top), or start it with "
            "a higher priority (nice -n -5)"
        )
    return (
        f"it cannot keep {pace}: it went at {went:.2f} times real time in the last "
        f"{real_ns / SECOND_NS:.0f} s; {why}. {_LOOKS_LIKE}"
    )
