"""Measures of one joint: its range of motion, and its tracking error."""

import collections
import math
from dataclasses import dataclass

BLOCK_NS, BLOCKS = 200_000_000, 10  # the error is over the last two seconds


class Extremes:
    """The range of an angle since it was last asked for."""

    def __init__(self) -> None:
        self._low, self._high = math.inf, -math.inf

    def take(self, angle: float) -> None:
        """Take one sample."""
        if angle < self._low:
            self._low = angle
        if angle > self._high:
            self._high = angle

    def end(self) -> float | None:
        """Return the range of all samples since the last call, None where there were none."""
        found = self._high - self._low
        self._low, self._high = math.inf, -math.inf
        return found if math.isfinite(found) else None


@dataclass(frozen=True, slots=True)
class Error:
    """Tracking error of a joint, over the last two seconds (rad)."""

    rms: float
    largest: float


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

    def at(self, now_ns: int) -> Error | None:
        """Return the error at `now_ns`, None where the window is empty."""
        window_ns = BLOCKS * BLOCK_NS
        pairs = zip(self._begins, self._blocks, strict=True)
        fresh = [block for began_ns, block in pairs if 0 <= now_ns - began_ns <= window_ns]
        if not fresh:
            return None
        rms = math.sqrt(sum(block[1] for block in fresh) / sum(block[0] for block in fresh))
        return Error(rms, max(block[2] for block in fresh))
