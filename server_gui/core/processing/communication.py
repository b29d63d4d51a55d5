"""Communication: how well one robot is reached, in figures and in words."""

import collections
import dataclasses
import statistics
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

from gateway.client import Batch, ConnectionState

SECONDS = 60  # of the window; figures are kept for each second
TRIPS = 60  # round trips, one a look at the resources
JITTER_SHARE = 16  # of RFC 3550
LOSS_POOR, LOSS_FAIR = 0.01, 0.001  # share of the rows
AGE_POOR_S, AGE_FAIR_S = 0.5, 0.15
JITTER_FAIR_S = 0.05
TRIP_FAIR_S = 0.1
SILENT_NS = 2_000_000_000
CALENDAR_NS = 60_000_000_000  # a robot whose calendar is further off than this has a wrong one


class Health(StrEnum):
    """Health of a link: whether its data are complete and new."""

    GOOD = "good"
    FAIR = "fair"
    POOR = "poor"
    DOWN = "down"


@dataclass(frozen=True, slots=True)
class LinkQuality:
    """One link over the last minute; times in s, None where nothing is known."""

    health: Health
    reasons: tuple[str, ...]  # in words, why it is not good
    round_trip: float | None = None  # median
    round_trip_worst: float | None = None
    jitter: float | None = None  # of the arrival of batches: RFC 3550 §6.4.1
    age: float | None = None  # median of the newest row's age on arrival
    loss: float | None = None  # share of the rows that never came
    rows_per_s: float = 0.0
    reconnects: int = 0


@dataclass(slots=True)
class _Second:
    """Counts of one second."""

    second: int
    rows: int = 0
    lost: int = 0
    reconnects: int = 0
    age_ns: int | None = None  # the worst


class LinkMonitor:
    """Takes batches, round trips and changes of one link; memory is bounded. Times are on our clock."""

    def __init__(self) -> None:
        self._state = ConnectionState.IDLE
        self._problem: str | None = None
        self._was_up = False
        self._seconds: collections.deque[_Second] = collections.deque(maxlen=SECONDS)
        self._trips: collections.deque[int] = collections.deque(maxlen=TRIPS)
        self._jitter_ns: float | None = None
        self._transit_ns: int | None = None
        self._dropped: dict[int, int] = {}  # by the robot on this link until now, by stream
        self._link: int | None = None
        self._began_ns: int | None = None
        self._newest_ns: int | None = None
        self._refused: tuple[int, str] | None = None  # when and why something was, the last time
        self._calendar_ns = 0  # robot's minus ours

    def state(self, state: ConnectionState, problem: str | None, at_ns: int) -> None:
        """Take a change of the link."""
        if state is ConnectionState.CONNECTED and self._state is not state:
            self._second(at_ns).reconnects += self._was_up
            self._was_up = True
        self._state, self._problem = state, problem

    def round_trip(self, round_trip_ns: int | None) -> None:
        """Take a measured round trip."""
        if round_trip_ns is not None:
            self._trips.append(round_trip_ns)

    def take(self, stream: int, batch: Batch, age_ns: int | None) -> None:
        """Take a batch; `age_ns` is the age of its newest row."""
        if batch.link != self._link:
            self._link, self._transit_ns = batch.link, None
            self._dropped.clear()
        second, rows = self._second(batch.received_ns), len(batch.stamps_ns)
        second.rows += rows
        # A notification that never came held about as many rows as this one.
        second.lost += max(0, batch.dropped - self._dropped.get(stream, 0)) + batch.missed * max(1, rows)
        self._dropped[stream] = batch.dropped
        if age_ns is not None:
            second.age_ns = max(age_ns, second.age_ns or 0)
        if rows:
            self._arrived(batch.received_ns - batch.stamps_ns[-1])
        self._began_ns = batch.received_ns if self._began_ns is None else self._began_ns
        self._newest_ns = batch.received_ns

    def refused(self, why: str, at_ns: int) -> None:
        """Count invalid data from the robot."""
        self._refused = at_ns, why

    def calendar(self, ahead_ns: int) -> None:
        """Take the difference of the robot's calendar from ours at its description."""
        self._calendar_ns = ahead_ns

    def quality(self, now_ns: int) -> LinkQuality:
        """Return the link over the minute before `now_ns`."""
        oldest = now_ns // 1_000_000_000 - SECONDS
        recent = [second for second in self._seconds if second.second > oldest]
        rows, lost = sum(second.rows for second in recent), sum(second.lost for second in recent)
        ages = [second.age_ns / 1e9 for second in recent if second.age_ns is not None]
        trips = [trip / 1e9 for trip in self._trips]
        seen_s = 0.0 if self._began_ns is None else (now_ns - self._began_ns) / 1e9
        figures = LinkQuality(
            health=Health.GOOD,
            reasons=(),
            round_trip=statistics.median(trips) if trips else None,
            round_trip_worst=max(trips) if trips else None,
            jitter=None if self._jitter_ns is None else self._jitter_ns / 1e9,
            age=statistics.median(ages) if ages else None,
            loss=lost / (rows + lost) if rows + lost else None,
            rows_per_s=rows / min(max(seen_s, 1.0), SECONDS),
            reconnects=sum(second.reconnects for second in recent),
        )
        return self._judged(figures, now_ns)

    def _arrived(self, transit_ns: int) -> None:
        """Interarrival jitter: how much the way of one batch differs from the last one's, smoothed."""
        if self._transit_ns is not None:
            step = abs(transit_ns - self._transit_ns)
            before = self._jitter_ns or 0.0
            self._jitter_ns = before + (step - before) / JITTER_SHARE
        self._transit_ns = transit_ns

    def _second(self, at_ns: int) -> _Second:
        second = at_ns // 1_000_000_000
        if not self._seconds or self._seconds[-1].second != second:
            self._seconds.append(_Second(second))
        return self._seconds[-1]

    def _judged(self, found: LinkQuality, now_ns: int) -> LinkQuality:
        reasons = [(health, text) for health, holds, text in self._complaints(found, now_ns) if holds]
        worst = max((health for health, _ in reasons), key=list(Health).index, default=Health.GOOD)
        return dataclasses.replace(found, health=worst, reasons=tuple(text for _, text in reasons))

    def _complaints(self, found: LinkQuality, now_ns: int) -> list[tuple[Health, bool, str]]:
        if self._state is not ConnectionState.CONNECTED:
            return [(Health.DOWN, True, self._problem or f"the link is {self._state.value}")]
        own = [*self._lies(now_ns)]
        if self._newest_ns is None or now_ns - self._newest_ns > SILENT_NS:
            return [*own, (Health.POOR, True, "connected, but no rows come: is something streamed?")]
        return [*own, *_complaints(found)]

    def _lies(self, now_ns: int) -> Iterator[tuple[Health, bool, str]]:
        """Yield impossible statements of the robot."""
        if self._refused is not None:
            at_ns, why = self._refused
            yield Health.POOR, now_ns - at_ns < SECONDS * 1e9, f"it sends what cannot be kept: {why}"
        off_s = abs(self._calendar_ns) // 1_000_000_000
        wrong = f"its calendar is {off_s} s from ours, so the times in its journal are wrong; set its clock"
        yield Health.FAIR, abs(self._calendar_ns) > CALENDAR_NS, wrong


def _complaints(found: LinkQuality) -> list[tuple[Health, bool, str]]:
    """Return possible problems of a link that is up: severity, whether it is present, and words."""
    loss, age, jitter, trip = (
        value or 0.0 for value in (found.loss, found.age, found.jitter, found.round_trip)
    )
    lost = f"{100.0 * loss:.2g} % of the rows are lost: the network or this computer is too slow"
    late = f"rows are {1000.0 * age:.0f} ms old when they come"
    return [
        (Health.POOR, loss > LOSS_POOR, lost),
        (Health.FAIR, LOSS_FAIR < loss <= LOSS_POOR, lost),
        (Health.POOR, age > AGE_POOR_S, late),
        (Health.FAIR, AGE_FAIR_S < age <= AGE_POOR_S, late),
        (Health.FAIR, jitter > JITTER_FAIR_S, f"rows come unevenly, by {1000.0 * jitter:.0f} ms"),
        (Health.FAIR, trip > TRIP_FAIR_S, f"an answer takes {1000.0 * trip:.0f} ms"),
        (
            Health.FAIR,
            found.reconnects > 0,
            f"the link was made again in the last minute, {found.reconnects}×",
        ),
    ]
