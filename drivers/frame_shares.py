"""The share of a sensor's frames that are missing or saturated, where it is too large."""

from collections.abc import Sequence
from dataclasses import replace

from drivers.findings import FindingState
from drivers.samples import Finding, Quality

WINDOW_S = 5.0
FEWEST = 20  # frames in a window that say something


class FrameShare(FindingState):
    """Fed with two counters; told from the share `many` on, until it is less than half of that."""

    def __init__(self, many: float, words: str, check: str) -> None:
        super().__init__()
        self._many, self._words, self._check = many, words, check
        self.restart()

    def restart(self) -> None:
        """Restart the counters."""
        self.clear()
        self._before: tuple[int, int, int] | None = None

    def skip(self, now_ns: int, part: int, whole: int) -> None:
        """Discard the frames until now: they say nothing of the sensor."""
        self._before = now_ns, part, whole

    def update(self, now_ns: int, part: int, whole: int) -> None:
        """Take the part and the whole of all frames since the counters began."""
        if self._before is None:
            self._before = now_ns, part, whole
        began_ns, part_before, whole_before = self._before
        if now_ns - began_ns < WINDOW_S * 1e9 or whole - whole_before < FEWEST:
            return
        self._before = now_ns, part, whole
        share = (part - part_before) / (whole - whole_before)
        if share < self._many / 2:
            self.clear()
        elif share >= self._many or self.finding is not None:
            self.note(now_ns, f"{100 * share:.0f} % {self._words}", self._check)


def missing_frames() -> FrameShare:
    """Make the share of frames whose own numbers show missing ones."""
    return FrameShare(
        0.05,
        "of its frames are missing",
        "check its cable and connectors, and whether line or USB hub carry so much",
    )


def saturated_frames() -> FrameShare:
    """Make the share of frames with a value at the end of its range; hard steps now and then do not count."""
    return FrameShare(
        0.10,
        "of its frames have a cell at the end of its range, so that force reads too low",
        "check the range set in the device, its supply, and `saturation` in its calibration",
    )


def beside(quality: Quality, findings: Sequence[Finding], now_ns: int) -> Quality:
    """Return the quality, and what was found beside it."""
    texts = (quality.problem, *(finding.text(now_ns) for finding in findings))
    problem = "; ".join(text for text in texts if text) or None
    return replace(quality, problem=problem, findings=(*quality.findings, *findings))
