"""Whether a sensor's frames go missing on their way: by its own numbers, else by how many come."""

from drivers.noted import found
from drivers.pace import Pace
from drivers.parsing import Counters
from drivers.samples import Finding
from drivers.shares import missing_frames
from drivers.standstill import Standstill


class Losses:
    """Fed with what a line's parser has counted."""

    def __init__(self, standstill: Standstill) -> None:
        """`standstill` is that of the computer that reads: what that has missed is no sensor's fault."""
        self._missing, self._pace = missing_frames(), Pace()
        self._standstill = standstill
        self._stood = standstill.times

    def restart(self) -> None:
        """The line is another one."""
        self._missing.restart()
        self._pace.restart()

    def update(self, now_ns: int, counters: Counters, *, numbered: bool) -> None:
        """As they are since the line is there; whether the frames have numbers, in which a gap shows."""
        stood, whole = self._standstill.until(now_ns), counters.frames + counters.frames_missed
        if stood != self._stood:
            self._stood = stood
            self._missing.skip(now_ns, counters.frames_missed, whole)
            self._pace.skip(now_ns, counters.frames)
        self._missing.update(now_ns, counters.frames_missed, whole)
        if not numbered:
            self._pace.update(now_ns, counters.frames)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is missing."""
        return found([self._missing, self._pace])
