"""A robot's clock against ours."""

import time
from dataclasses import dataclass

from gateway.client import Batch, ClockOffset


@dataclass(frozen=True, slots=True)
class Clock:
    """A robot's clock against ours; where nobody knows it, the newest row is taken to have come at once."""

    offset_ns: int = 0
    known: bool = False

    @classmethod
    def of(cls, batch: Batch, clock: ClockOffset | None) -> "Clock":
        if clock is not None:
            return cls(clock.offset_ns, known=True)
        return cls(batch.stamps_ns[-1] - batch.received_ns if batch.stamps_ns else 0)

    def utc_ns(self, stamp_ns: int) -> int:
        """Return a moment of the robot's clock."""
        return stamp_ns - self.offset_ns + time.time_ns() - time.monotonic_ns()

    def age_ns(self, stamp_ns: int) -> int | None:
        """Return how long ago that was."""
        return time.monotonic_ns() + self.offset_ns - stamp_ns if self.known else None
