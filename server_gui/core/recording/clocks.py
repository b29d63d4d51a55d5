"""A robot's clock brought to UTC, so that within a connection UTC never goes back, whoever sets a clock."""

import time
from collections.abc import Sequence
from typing import Final, NamedTuple, Self

STEP_NS: Final = 10_000_000  # this server's clock is taken to have been set where it moves more at once
JUMP_NS: Final = 1_000_000_000  # likewise the robot's against ours; an estimate over a network is not better
SLEW: Final = 1_000  # the offset follows a better estimate by one part in so many of the time that goes by
_READ_NS: Final = 100_000  # two clocks are read together where that takes no longer
_ATTEMPTS: Final = 5


class Moment(NamedTuple):
    """An instant by this server's clocks."""

    utc_ns: int  # as its wall clock says
    to_utc_ns: int  # which is so much more than its monotonic clock

    @classmethod
    def now(cls) -> Self:
        """Read both clocks; again where something came between."""
        found = []
        for _ in range(_ATTEMPTS):
            before_ns, utc_ns, after_ns = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
            found.append((after_ns - before_ns, cls(utc_ns, utc_ns - (before_ns + after_ns) // 2)))
            if found[-1][0] < _READ_NS:
                break
        return min(found)[1]

    def before(self, ago_s: float) -> Self:
        """Return the instant so many seconds before; none after."""
        return self._replace(utc_ns=self.utc_ns - max(round(ago_s * 1e9), 0))


class ClockReading(NamedTuple):
    """Clocks at the arrival of a notification."""

    to_utc_ns: int  # this server's wall clock minus its monotonic one
    robot_ns: int  # the robot's monotonic clock minus ours
    known: bool  # whether it was asked; else its newest row is taken to have come without delay


class ClockStep(NamedTuple):
    """A clock was set: what it would have said, and what it said."""

    whose: str
    from_ns: int
    to_ns: int

    def __str__(self) -> str:
        return f"{self.whose} was set by {(self.to_ns - self.from_ns) / 1e9:+.3f} s"


class Clock:
    """One robot's, for the recorder's thread.

    On Linux the monotonic clock goes as fast as the wall clock, so between two steps their difference stays.
    It is held for a connection, and for the next one too where UTC would go back within the session. Before
    the robot was first asked for its clock its rows are taken to have come without delay.
    """

    def __init__(self) -> None:
        self._offset_ns: int | None = None  # UTC minus the robot's clock
        self._base_ns = 0  # UTC minus our monotonic clock, as held
        self._now = ClockReading(0, 0, known=False)
        self._newest_ns = 0  # of all stamps of the connection
        self._last: dict[int, tuple[int, int]] = {}  # by stream: its newest stamp, with which offset
        self._begins = True  # with the next row, a connection
        self._anew = True  # and a session, before which UTC may have been anything

    def session(self) -> None:
        """Begin another session: the next connection takes the clocks as they are."""
        self._anew = True

    def connection(self) -> None:
        """Begin another connection."""
        self._begins = True

    def take(self, stream: int, stamps_ns: Sequence[int], reading: ClockReading) -> int:
        """UTC minus the robot's clock for these rows."""
        if not stamps_ns:
            return reading.to_utc_ns - reading.robot_ns if self._offset_ns is None else self._offset_ns
        first_ns, newest_ns = stamps_ns[0], stamps_ns[-1]
        if self._offset_ns is None or (self._begins and self._may_begin(first_ns, reading)):
            self._base_ns, self._anew = reading.to_utc_ns, False
            self._offset_ns = self._base_ns - reading.robot_ns
        if self._begins:
            self._begins, self._newest_ns = False, newest_ns
            self._last.clear()
        asked = reading.known and self._now.known
        self._now = reading
        offset_ns = self._base_ns - reading.robot_ns
        if asked:
            offset_ns = self._slewed(self._offset_ns, offset_ns, newest_ns)
        last_ns, with_ns = self._last.get(stream, (first_ns, offset_ns))
        if first_ns >= last_ns:
            offset_ns = max(offset_ns, last_ns + with_ns - first_ns)
        self._newest_ns = max(self._newest_ns, newest_ns)
        self._last[stream] = newest_ns, offset_ns
        self._offset_ns = offset_ns
        return offset_ns

    def steps(self, received_ns: int, reading: ClockReading) -> list[ClockStep]:
        """Clocks that were set since the notification before; to be asked before it is taken."""
        if self._offset_ns is None:
            return []
        found, before = [], self._now
        if abs(reading.to_utc_ns - before.to_utc_ns) > STEP_NS:
            times_ns = (received_ns + each.to_utc_ns for each in (before, reading))
            found.append(ClockStep("this server's clock", *times_ns))
        asked = reading.known and before.known and not self._begins
        if asked and abs(reading.robot_ns - before.robot_ns) > JUMP_NS:
            times_ns = (received_ns + each.robot_ns for each in (before, reading))
            found.append(ClockStep("the robot's monotonic clock", *times_ns))
        return found

    def recorded_ns(self, moment: Moment) -> int:
        """Return an instant of ours in the UTC that this robot's rows have now."""
        if self._offset_ns is None:
            return moment.utc_ns
        to_utc_ns = self._now.robot_ns + self._offset_ns if self._now.known else self._base_ns
        return moment.utc_ns - moment.to_utc_ns + to_utc_ns

    def utc_ns(self, stamp_ns: int) -> int | None:
        """Return an instant of the robot's clock in that UTC; None where no row has come."""
        return None if self._offset_ns is None else stamp_ns + self._offset_ns

    def _may_begin(self, first_ns: int, reading: ClockReading) -> bool:
        """Return whether a new connection may take the clocks as they are."""
        before_ns = max((stamp_ns + offset_ns for stamp_ns, offset_ns in self._last.values()), default=0)
        goes_on = first_ns + reading.to_utc_ns - reading.robot_ns > before_ns
        return self._anew or goes_on or first_ns < self._newest_ns  # or it is another boot

    def _slewed(self, held_ns: int, wanted_ns: int, newest_ns: int) -> int:
        """Nearer to the wanted offset; as it was where a clock has jumped."""
        most = max(0, newest_ns - self._newest_ns) // SLEW
        apart = wanted_ns - held_ns
        if abs(apart) > JUMP_NS:
            return held_ns
        return held_ns + max(-most, min(most, apart))
