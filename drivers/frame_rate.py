"""The frame rate of a sensor that does not number its frames: a drop is the only sign of a loss."""

from drivers.findings import FindingState

WINDOW_S = 5.0  # long enough that an adapter which delivers in bursts makes no difference
FEWER, FEW_NO_MORE = 0.93, 0.97  # of what came before
FEWEST = 20  # frames in a window that say something
_CHECK = "check its cable and connectors, whether line or USB hub carry so much, and its rate"


class FrameRate(FindingState):
    """Fed with how many frames have come; told where fewer come than in the best window since it is there."""

    def __init__(self) -> None:
        super().__init__()
        self.restart()

    def restart(self) -> None:
        """Restart for another line."""
        self.clear()
        self._best_hz = 0.0
        self._before: tuple[int, int] | None = None
        self._windows = 0

    def skip(self, now_ns: int, frames: int) -> None:
        """Discard the frames until now: they say nothing of the sensor."""
        self._before = now_ns, frames

    def update(self, now_ns: int, frames: int) -> None:
        """Take the number of frames since the line was opened."""
        if self._before is None:
            self._before = now_ns, frames
        began_ns, frames_before = self._before
        seconds, came = (now_ns - began_ns) / 1e9, frames - frames_before
        if seconds < WINDOW_S or came < FEWEST:
            return
        self._before = now_ns, frames
        self._windows += 1
        if self._windows > 1:  # the first one has what the port had kept
            self._judge(now_ns, came / seconds)

    def _judge(self, now_ns: int, rate_hz: float) -> None:
        self._best_hz = max(self._best_hz, rate_hz)
        if rate_hz >= FEW_NO_MORE * self._best_hz:
            self.clear()
        elif rate_hz < FEWER * self._best_hz or self.finding is not None:
            words = f"{rate_hz:.0f} frames a second come, {self._best_hz:.0f} came before"
            self.note(now_ns, words, _CHECK)
