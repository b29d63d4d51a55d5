"""Offset between the robot's clocks and ours, from exchanges of `clock.read`."""

import collections
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """Robot's clock minus ours, right to within ±`uncertainty_ns` (half the round trip)."""

    offset_ns: int
    uncertainty_ns: int


class ClockTracker:
    """The best of the latest exchanges: the one with the shortest round trip.

    A network delays one way or the other, never less than nothing, so the true offset lies within half the
    round trip of the middle. The window is short, so that a drift between the clocks does not gather.
    """

    def __init__(self, window: int = 16) -> None:
        self._exchanges: collections.deque[ClockOffset] = collections.deque(maxlen=window)
        self.round_trip_ns: int | None = None

    def clear(self) -> None:
        """Forget everything: another boot of the robot has another clock."""
        self._exchanges.clear()
        self.round_trip_ns = None

    def feed(self, sent_ns: int, robot_ns: int, received_ns: int) -> None:
        """Take one exchange: our clock when it was sent, the robot's answer, our clock when that came."""
        self.round_trip_ns = received_ns - sent_ns
        middle_ns = sent_ns + self.round_trip_ns // 2
        self._exchanges.append(ClockOffset(robot_ns - middle_ns, (self.round_trip_ns + 1) // 2))

    @property
    def offset(self) -> ClockOffset | None:
        """The best estimate, None before the first exchange."""
        return min(self._exchanges, key=lambda exchange: exchange.uncertainty_ns, default=None)
