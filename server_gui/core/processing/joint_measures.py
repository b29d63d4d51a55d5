"""What one joint does: its range of motion in each stride, and how well it follows its target."""

import collections
import math
import statistics
from dataclasses import dataclass

from server_gui.core.processing.gait_measures import STRIDES

BLOCK_NS, BLOCKS = 200_000_000, 10  # the error is over the last two seconds


@dataclass(frozen=True, slots=True)
class JointShown:
    """One joint as it is now, in rad; None where it is not known."""

    range_of_motion: float | None = None  # mean over the newest strides
    error_rms: float | None = None
    error_max: float | None = None


class RangeOfMotion:
    """The range of an angle over each stride: from one known heel strike of its leg to the next."""

    def __init__(self) -> None:
        self.ranges: collections.deque[float] = collections.deque(maxlen=STRIDES)
        self._low, self._high = math.inf, -math.inf

    def take(self, angle: float) -> None:
        """Take one sample (rad)."""
        if angle < self._low:
            self._low = angle
        if angle > self._high:
            self._high = angle

    def struck(self, whole: bool) -> float | None:
        """Its leg's heel strike was found; the range (rad) since the last, where a `whole` stride ended."""
        seen = self._high - self._low
        self._low, self._high = math.inf, -math.inf
        if not whole or not math.isfinite(seen):
            return None
        self.ranges.append(seen)
        return seen

    @property
    def mean(self) -> float | None:
        return statistics.fmean(self.ranges) if self.ranges else None


class TrackingError:
    """Root mean square and largest magnitude of an error over a sliding window, in blocks of 0.2 s."""

    def __init__(self) -> None:
        self._blocks: collections.deque[list[float]] = collections.deque(maxlen=BLOCKS)  # n, Σ e², max |e|
        self._begins: collections.deque[int] = collections.deque(maxlen=BLOCKS)

    def take(self, stamp_ns: int, error: float) -> None:
        """Take one sample (rad): target − position, as the drive's following error (60F4h) is."""
        begins = self._begins
        if not begins or not 0 <= stamp_ns - begins[-1] < BLOCK_NS:
            begins.append(stamp_ns)
            self._blocks.append([0.0, 0.0, 0.0])
        block = self._blocks[-1]
        block[0] += 1.0
        block[1] += error * error
        block[2] = max(block[2], abs(error))

    def at(self, now_ns: int) -> tuple[float | None, float | None]:
        """RMS and maximum at `now_ns` (rad); None where the window is empty."""
        window_ns = BLOCKS * BLOCK_NS
        pairs = zip(self._begins, self._blocks, strict=True)
        fresh = [block for began_ns, block in pairs if 0 <= now_ns - began_ns <= window_ns]
        if not fresh:
            return None, None
        rms = math.sqrt(sum(block[1] for block in fresh) / sum(block[0] for block in fresh))
        return rms, max(block[2] for block in fresh)
