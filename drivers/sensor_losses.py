"""Lost frames of a sensor: by its sequence numbers, else by its rate."""

from drivers.findings import active_findings
from drivers.frame_rate import FrameRate
from drivers.frame_shares import missing_frames
from drivers.parsing import Counters
from drivers.reader_stalls import ReaderStalls
from drivers.samples import Finding


class Losses:
    """Fed with what a line's parser has counted."""

    def __init__(self, standstill: ReaderStalls) -> None:
        """`standstill` is that of the computer that reads: what that has missed is no sensor's fault."""
        self._missing, self._pace = missing_frames(), FrameRate()
        self._standstill = standstill
        self._stood = standstill.times

    def restart(self) -> None:
        """Restart for another line."""
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
        """Problems of missing frames."""
        return active_findings([self._missing, self._pace])
