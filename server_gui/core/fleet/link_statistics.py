"""Statistics of a robot's link, counted from the feed's events, in the network's thread."""

import collections
import time
from typing import Final

from msgspec import Struct

from gateway.client import Address, ClockOffset, ConnectionState
from server_gui.core.follow.events import Described, Event, LinkChanged, Refused, Resources, Telemetry
from server_gui.core.processing.communication import LinkMonitor, LinkQuality
from server_gui.core.recording.rows import KEYS, VALUE

RATE_S: Final = 5  # rows a second are counted over so long
SECOND_NS: Final = 1_000_000_000


class LinkReport(Struct, frozen=True):
    """A robot's link now, for people and machines; what is not known yet is None. Seconds, UTC."""

    address: str
    state: str
    problem: str | None  # why there is no link
    since_utc_s: float | None  # when it was made, or for how long there has been none
    calls_itself: str | None
    links: int  # made since the start
    session: str
    rows: int
    rows_per_s: float
    bytes: int  # that its rows take in the spool
    received: int  # bytes that came over the network
    received_per_s: float | None  # between the newest two looks at the robot's computer
    missed: int  # notifications that never came
    dropped: int  # rows that the robot threw away
    newest_age_s: float | None  # since rows came
    quality: LinkQuality  # over the last minute
    clock_offset_s: float | None  # the robot's monotonic clock minus ours
    clock_uncertainty_s: float | None
    recording_since_utc_s: float | None = None  # this session
    notes: str = ""  # its notes
    wearer: str = ""  # whose walk it is of, or would be


class LinkStatistics:
    """One robot's counters."""

    def __init__(self, address: Address) -> None:
        self.state = ConnectionState.IDLE
        self.newest_ns: int | None = None  # when rows came, on our monotonic clock
        self._address = address
        self._problem: str | None = None
        self._since_s: float | None = None
        self._calls_itself: str | None = None
        self._links = 0
        self._rows = 0
        self._bytes = 0
        self._missed = 0
        self._dropped = 0
        self._stream = (0, 0)  # link and stream; what the robot dropped is counted anew with each
        self._dropped_before = 0
        self._received = (0, 0)  # bytes, and when that was
        self._received_per_s: float | None = None
        self._monitor = LinkMonitor()
        self._clock: ClockOffset | None = None
        self._flows_since = 0  # second of the first row of this link
        self._recent: collections.deque[tuple[int, int]] = collections.deque(
            maxlen=RATE_S + 1
        )  # second, rows

    def take(self, event: Event) -> None:
        """Count what an event tells."""
        match event:
            case Telemetry():
                self._telemetry(event)
            case Resources():
                self._monitor.round_trip(event.round_trip_ns)
                self._look(event.received_bytes, event.at_ns)
            case Described():
                self._calls_itself = event.description.robot
                self._monitor.calendar(event.calendar_ns)
            case Refused():
                self._monitor.refused(event.reason, time.monotonic_ns())
            case LinkChanged():
                linked = event.state is ConnectionState.CONNECTED
                self._links += linked
                if self._since_s is None or linked or self.state is ConnectionState.CONNECTED:
                    self._since_s = time.time()
                self.state, self._problem = event.state, event.problem
                self._received_per_s, self._flows_since = None, 0
                self._monitor.state(event.state, event.problem, event.at_ns)

    def report(self, session: str) -> LinkReport:
        """Return how it stands now."""
        now_ns = time.monotonic_ns()
        return LinkReport(
            address=str(self._address),
            state=self.state.value,
            problem=self._problem,
            since_utc_s=self._since_s,
            calls_itself=self._calls_itself,
            links=self._links,
            session=session,
            rows=self._rows,
            rows_per_s=self._rows_per_s(now_ns),
            bytes=self._bytes,
            received=self._received[0],
            received_per_s=self._received_per_s,
            missed=self._missed,
            dropped=self._dropped,
            newest_age_s=None if self.newest_ns is None else (now_ns - self.newest_ns) / 1e9,
            quality=self._monitor.quality(now_ns),
            clock_offset_s=None if self._clock is None else self._clock.offset_ns / 1e9,
            clock_uncertainty_s=None if self._clock is None else self._clock.uncertainty_ns / 1e9,
        )

    def _look(self, received: int, at_ns: int) -> None:
        before, before_ns = self._received
        if before_ns and received > before:
            self._received_per_s = (received - before) * 1e9 / (at_ns - before_ns)
        self._received = received, at_ns

    def _telemetry(self, event: Telemetry) -> None:
        self._monitor.take(event.stream, event.batch, event.age_ns)
        batch = event.batch
        rows = len(batch.stamps_ns)
        self._rows += rows
        self._bytes += VALUE.itemsize * rows * (KEYS + len(batch.columns))
        self._missed += batch.missed
        self._clock = event.clock
        self.newest_ns = batch.received_ns
        stream = (batch.link, event.stream)
        if stream != self._stream:
            self._stream, self._dropped_before = stream, self._dropped
        self._dropped = self._dropped_before + batch.dropped
        second = batch.received_ns // SECOND_NS
        self._flows_since = self._flows_since or second
        if not self._recent or self._recent[-1][0] != second:
            self._recent.append((second, 0))
        self._recent[-1] = (second, self._recent[-1][1] + rows)

    def _rows_per_s(self, now_ns: int) -> float:
        """Over the last whole seconds, of those that followed the link's first row; 0 before one is whole."""
        now = now_ns // SECOND_NS
        first = max(now - RATE_S, self._flows_since + 1)
        rows = sum(rows for second, rows in self._recent if first <= second < now)
        return rows / (now - first) if self._flows_since and first < now else 0.0
