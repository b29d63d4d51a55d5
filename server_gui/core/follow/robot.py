"""Present state of one robot: events go in, views read it. No Qt, no threads."""

import collections
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import msgspec

from gateway.client import ConnectionState
from gateway.plain_text import one_line
from gateway.wire.bus import BusInfo
from gateway.wire.component import QualityInfo
from gateway.wire.parameter import ParameterValue
from gateway.wire.resource import ResourceSnapshot
from gateway.wire.robot import Description, Hello
from server_gui.core.follow import frame_time
from server_gui.core.follow.events import (
    BusesSeen,
    Described,
    Event,
    Failed,
    LinkChanged,
    Looked,
    Resources,
    Telemetry,
)
from server_gui.core.follow.missing_pdos import MissingPdos

STALE_NS = 500_000_000  # older than this is shown as old
RATE_WINDOW_NS = 2_000_000_000
COMES_UP = "it was not read yet"  # as a gateway says of what it has asked for the first time just now
BUSY_NS = 5_000_000_000  # what was seen of its computer before is not known now
SLOW = 0.8  # of the rate that was asked for: below that it is said


@dataclass(frozen=True, slots=True)
class FollowedComponent:
    """One component as it was last seen."""

    name: str
    kind: str
    state: str
    age_ms: float | None
    problem: str | None

    @property
    def comes_up(self) -> bool:
        """Whether the robot has only begun to read it."""
        return (self.problem or "").startswith(COMES_UP)


@dataclass(slots=True)
class LinkStatus:
    """State and quality of the link to the robot."""

    state: ConnectionState = ConnectionState.IDLE
    problem: str | None = None
    is_another: bool = False  # what answers has another key than the robot that was paired
    since_ns: int = 0
    links: int = 0
    missed: int = 0  # notifications
    dropped: int = 0  # rows
    round_trip_ns: int | None = None


@dataclass(slots=True)
class Robot:
    """The newest facts of one robot, for one thread; `apply` is the only writer.

    Values are those of the last row. They stay when the link drops, and `age_s` says how old they are: a
    view shows nothing as live when `is_stale`.
    """

    link: LinkStatus = field(default_factory=LinkStatus)
    description: Description | None = None
    hello: Hello | None = None  # who we are there, and what we may not
    values: dict[str, float | None] = field(default_factory=dict)
    parts: dict[str, FollowedComponent] = field(default_factory=dict)
    parameters: dict[str, ParameterValue] = field(default_factory=dict)
    parameters_at_ns: int | None = None
    looked_at_ns: int | None = None  # when the states of its components came last
    resources: ResourceSnapshot | None = None
    resources_at_ns: int | None = None
    buses: tuple[BusInfo, ...] | None = None  # None: not known
    buses_at_ns: int | None = None
    last_failure: Failed | None = None
    asked_hz: float = 0.0  # rows a second; 0: as they come
    start_by: str = ""  # what starts its controller, where that is known: of our simulator
    is_recording: bool = False  # then there is nobody whose state could be good
    _newest_ns: int | None = None  # when the newest row was taken, on our clock
    _arrivals: collections.deque[tuple[int, int]] = field(
        default_factory=lambda: collections.deque(maxlen=4096)
    )
    _missing: MissingPdos = field(default_factory=MissingPdos)
    _dropped_seen: int = 0
    _flows_since_ns: int = 0  # the first rows of this link
    _words: dict[str, dict[str, str]] = field(default_factory=dict)

    def apply(self, event: Event) -> None:
        """Take one fact."""
        match event:
            case Telemetry():
                self._telemetry(event)
            case Looked():
                self._looked(event)
            case Resources():
                self.resources, self.resources_at_ns = event.snapshot, event.at_ns
                self.link.round_trip_ns = event.round_trip_ns
            case BusesSeen():
                self.buses_at_ns = event.at_ns
                self.buses = None if event.buses is None else self._judged(event.buses, event.at_ns)
            case LinkChanged():
                self._link_changed(event)
            case Described():
                self._described(event)
            case Failed():
                self.last_failure = event

    def _judged(self, buses: Sequence[BusInfo], at_ns: int) -> tuple[BusInfo, ...]:
        return self._missing.take(buses, at_ns, self.cpu_percent(at_ns))

    def hold(self, values: Mapping[str, float]) -> None:
        """Take values just read from devices."""
        for name, value in values.items():
            if name in self.parameters:
                self.parameters[name] = msgspec.structs.replace(self.parameters[name], value=value)

    def holds(self, values: Mapping[str, float]) -> bool:
        """Return whether its parameters were read to have just these values."""
        held = self.parameters
        return all(name in held and held[name].value == value for name, value in values.items())

    # --- what views ask

    def cpu_percent(self, now_ns: int | None = None) -> float | None:
        """Return how busy the robot's computer is; None where that was not seen of late."""
        now_ns = frame_time.now_ns() if now_ns is None else now_ns
        if self.resources is None or self.resources_at_ns is None or now_ns - self.resources_at_ns >= BUSY_NS:
            return None
        return self.resources.cpu.percent

    def age_s(self, now_ns: int | None = None) -> float | None:
        """Return seconds since the newest row was taken; None before the first."""
        if self._newest_ns is None:
            return None
        return max(0, (frame_time.now_ns() if now_ns is None else now_ns) - self._newest_ns) / 1e9

    def is_stale(self, now_ns: int | None = None) -> bool:
        """Return whether the values are too old to be called live."""
        age_s = self.age_s(now_ns)
        return age_s is None or age_s * 1e9 > STALE_NS

    @property
    def unlooked_s(self) -> float:
        """Seconds since its components' states came, or since there is a link without any."""
        since_ns = max(self.looked_at_ns or 0, self.link.since_ns)
        return (frame_time.now_ns() - since_ns) / 1e9

    def is_newer_than(self, at_ns: int) -> bool:
        """Return whether the newest row was taken after this instant, of our clock."""
        return self._newest_ns is not None and self._newest_ns > at_ns

    def rate_hz(self, now_ns: int | None = None) -> float:
        """Return rows a second over the last two seconds."""
        now_ns = frame_time.now_ns() if now_ns is None else now_ns
        recent = sum(rows for at_ns, rows in self._arrivals if now_ns - at_ns <= RATE_WINDOW_NS)
        return recent / (RATE_WINDOW_NS / 1e9)

    def has_rate(self, now_ns: int | None = None) -> bool:
        """Return whether rows have come over this link for as long as a rate is counted over."""
        now_ns = frame_time.now_ns() if now_ns is None else now_ns
        return self._flows_since_ns > 0 and now_ns - self._flows_since_ns > RATE_WINDOW_NS

    def is_slow(self, now_ns: int | None = None) -> bool:
        """Return whether fewer rows come than were asked for; not before that is known."""
        now_ns = frame_time.now_ns() if now_ns is None else now_ns
        return self.has_rate(now_ns) and self.rate_hz(now_ns) < SLOW * self.asked_hz

    def rate_text(self, now_ns: int | None = None) -> str:
        """Return the row rate in words, with the requested rate if it is lower; a dash until it is known."""
        if not self.has_rate(now_ns):
            return "– Hz"
        of = f" of {self.asked_hz:.0f}" if self.is_slow(now_ns) else ""
        return f"{self.rate_hz(now_ns):.0f}{of} Hz"

    def now_s(self) -> float:
        """Return the instant that is shown, UTC."""
        return time.time()

    @property
    def is_linked(self) -> bool:
        """Whether there is a link now."""
        return self.link.state is ConnectionState.CONNECTED

    @property
    def boot_id(self) -> str | None:
        """Which start of the robot's computer this is, once it has said so."""
        return None if self.description is None else self.description.boot_id

    def names(self, kind: str) -> list[str]:
        """Return the components of one kind, in the robot's order."""
        return [part.name for part in self.parts.values() if part.kind == kind]

    def not_ok(self) -> list[FollowedComponent]:
        """Return the components whose values cannot be trusted now."""
        return [part for part in self.parts.values() if part.state != "ok"]

    def word(self, channel: str) -> str | None:
        """Return a state's word, None where there is none."""
        return self.word_of(channel, self.values.get(channel))

    def word_of(self, channel: str, value: float | None) -> str | None:
        """Return the word of a state's number, None where there is none."""
        words = self._words.get(channel)
        if value is None or words is None or not math.isfinite(value):
            return None
        return words.get(str(int(value)), str(int(value)))

    @property
    def state_words(self) -> Mapping[str, Mapping[str, str]]:
        """Words for the numbers of each channel that is a state."""
        return self._words

    # --- what events do

    def _link_changed(self, event: LinkChanged) -> None:
        link = self.link
        link.links += event.state is ConnectionState.CONNECTED
        self._flows_since_ns = 0
        link.state, link.problem, link.since_ns = event.state, event.problem, event.at_ns
        if event.problem is not None or event.state is ConnectionState.CONNECTED:
            link.is_another = event.is_another

    def _described(self, event: Described) -> None:
        if self.description is not None and self.description.boot_id != event.description.boot_id:
            self._missing = MissingPdos()  # what was before another start of the robot lasts no longer
        self.description, self.hello = event.description, event.hello
        known = {channel.name for channel in event.description.channels}
        self.values = {name: value for name, value in self.values.items() if name in known}
        self._words = {channel.name: channel.enum for channel in event.description.channels if channel.enum}
        self.parts = {
            part.name: FollowedComponent(part.name, part.kind, part.state, None, _problem(part.problem))
            for part in event.description.components
        }

    def _telemetry(self, event: Telemetry) -> None:
        batch = event.batch
        rows = len(batch.stamps_ns)
        if not rows:
            return
        for name, column in batch.columns.items():
            self.values[name] = column[-1]
        self._newest_ns = batch.received_ns - (event.age_ns or 0)
        self._arrivals.append((batch.received_ns, rows))
        self.asked_hz = event.asked_hz
        self._flows_since_ns = self._flows_since_ns or batch.received_ns
        self.link.missed += batch.missed
        self.link.dropped += max(0, batch.dropped - self._dropped_seen)
        self._dropped_seen = batch.dropped

    def _looked(self, event: Looked) -> None:
        self.looked_at_ns = event.at_ns
        for name, found in event.quality.quality.items():
            if name in self.parts:
                self.parts[name] = _part(self.parts[name], found)
        if event.parameters is not None:
            self.parameters = dict(event.parameters.values)
            self.parameters_at_ns = event.at_ns


def _part(known: FollowedComponent, found: QualityInfo) -> FollowedComponent:
    age_ms = found.get("age_ms")
    problem = found.get("problem")
    return FollowedComponent(
        known.name,
        known.kind,
        str(found.get("state", "unknown")),
        age_ms if isinstance(age_ms, int | float) else None,
        _problem(problem),
    )


def _problem(problem: object) -> str | None:
    return None if problem is None else one_line(str(problem))
