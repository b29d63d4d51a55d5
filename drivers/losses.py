"""Whether a sensor's frames go missing on their way: by its own numbers, else by how many come."""

from drivers.noted import found
from drivers.pace import Pace
from drivers.parsing import Counters
from drivers.samples import Finding
from drivers.shares import missing_frames


class Losses:
    """Fed with what a line's parser has counted."""

    def __init__(self) -> None:
        self._missing, self._pace = missing_frames(), Pace()

    def restart(self) -> None:
        """The line is another one."""
        self._missing.restart()
        self._pace.restart()

    def update(self, now_ns: int, counters: Counters, *, numbered: bool) -> None:
        """As they are since the line is there; whether the frames have numbers, in which a gap shows."""
        self._missing.update(now_ns, counters.frames_missed, counters.frames + counters.frames_missed)
        if not numbered:
            self._pace.update(now_ns, counters.frames)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is missing."""
        return found([self._missing, self._pace])
