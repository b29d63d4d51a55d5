"""All that the doctor goes by, gathered once; what is not known is not there, and never a number."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isfinite

from drivers.bus.interfaces.controller_state import BusState
from drivers.joint.quantities import AXIS_OFFSET
from eds import Description
from gateway.config.robot import DeviceTable, JointTable, RobotConfig

NodeTable = JointTable | DeviceTable
Object = tuple[int, int]  # index and sub-index
Value = int | float | None

FIRST_PROFILE_OBJECT = 0x6000


@dataclass(frozen=True, slots=True)
class IdentifierFrames:
    """The frames of one identifier while the bus was listened to."""

    count: int
    per_s: float  # by the time between the first and the last
    asks: int = 0  # of an SDO client's: transfers that were begun


@dataclass(frozen=True, slots=True)
class BusFacts:
    """One bus over `seconds`; `heard` is `None` where it was not listened to, but by a gateway elsewhere."""

    seconds: float
    heard: Mapping[int, IdentifierFrames] | None
    frames_per_s: float | None
    load_percent: float | None
    error_frames_per_s: float | None
    state: BusState
    trouble: str | None = None  # what its controller or its link says
    asked_by_us: Mapping[int, int] = field(default_factory=dict)  # node → SDO transfers that a gateway began

    @property
    def is_silent(self) -> bool:
        """Whether nobody was heard at all."""
        return not self.frames_per_s if self.heard is None else not self.heard


@dataclass(frozen=True, slots=True)
class Samples:
    """Channels over time, a row each `period_s`; `None` where a value was missing or stale."""

    period_s: float = 0.02
    columns: Mapping[str, tuple[float | None, ...]] = field(default_factory=dict)
    why_none: str = "nothing was sampled"
    problems: Mapping[str, str] = field(default_factory=dict)  # component → what its driver says is wrong

    @property
    def seconds(self) -> float:
        """Length of the observation."""
        return self.period_s * max((len(column) for column in self.columns.values()), default=0)


@dataclass(frozen=True, slots=True)
class Computer:
    """The robot's computer; `None` is not known."""

    governors: tuple[str, ...] | None = None  # of each group of cores
    realtime_allowed: bool | None = None
    clock_synchronised: bool | None = None
    queue_lengths: Mapping[str, int] = field(default_factory=dict)  # CAN interface → frames
    latency_ms: Mapping[str, int] | None = None  # USB serial port's device → its timer
    missing_ports: frozenset[str] = frozenset()  # of the file, that are not there
    why_none: str = "this is not the robot's computer"


@dataclass(frozen=True, slots=True)
class Place:
    """A joint or device of the file: where it is."""

    kind: str
    name: str
    table: JointTable | DeviceTable

    @property
    def axis(self) -> int:
        return self.table.axis if isinstance(self.table, JointTable) else 0

    @property
    def header(self) -> str:
        return f"[{self.kind}.{self.name}]"


@dataclass(frozen=True, slots=True)
class Observations:
    """A robot, looked at once."""

    config: RobotConfig
    descriptions: Mapping[str, Description]
    buses: Mapping[str, BusFacts]
    objects: Mapping[str, Mapping[Object, Value]]  # component → what its device holds; None: it has no such
    samples: Samples
    computer: Computer
    proposals: Mapping[str, str] = field(default_factory=dict)  # component → EDS file for what it says it is
    why_no_objects: str = "devices are asked only through a gateway, or with --active"
    bus_obstacles: Mapping[str, str] = field(default_factory=dict)  # bus → why it cannot be opened as it is
    units: Mapping[str, tuple[float, str]] = field(default_factory=dict)  # parameter's address → scale, unit
    held: Mapping[str, str] = field(default_factory=dict)  # controller → its state, where that is held
    stop_held: str | None = None  # why a stop is held, where one is and a gateway was asked
    other_file: str | None = None  # why the gateway judges by another file than this

    def heard_on(self, bus: str) -> Mapping[int, IdentifierFrames] | None:
        """Return what came on a bus, by identifier; `None` if it was not listened to, or nobody was heard."""
        facts = self.buses.get(bus)
        return None if facts is None or facts.is_silent else facts.heard

    def joints(self) -> Iterator[Place]:
        return (Place("joint", name, table) for name, table in self.config.joint.items())

    def nodes(self) -> Iterator[Place]:
        """Yield joints and devices, one for each node."""
        seen: set[tuple[str, int]] = set()
        devices = (Place("device", name, table) for name, table in self.config.device.items())
        for place in (*self.joints(), *devices):
            node = (place.table.bus, place.table.node_id)
            if node not in seen:
                seen.add(node)
                yield place

    def holds(self, place: Place, index: int, subindex: int = 0) -> Value:
        """Return the device's value of an object of its own axis; `None` if it has none or gave none."""
        shift = AXIS_OFFSET * place.axis if index >= FIRST_PROFILE_OBJECT else 0
        return self.objects.get(place.name, {}).get((index + shift, subindex))

    def unanswered(self, place: Place, index: int, subindex: int = 0) -> bool:
        """Return whether its file has the object, but the device's value is unknown."""
        shift = AXIS_OFFSET * place.axis if index >= FIRST_PROFILE_OBJECT else 0
        description = self.descriptions.get(place.name)
        asked = (index + shift, subindex) in self.objects.get(place.name, {})
        return not asked and (description is None or description.has(index + shift, subindex))

    def whole(self, place: Place, index: int, subindex: int = 0) -> int | None:
        """Return the same as a whole number."""
        value = self.holds(place, index, subindex)
        return None if value is None else int(value)

    def why_no(self, channel: str) -> str:
        """Return why a channel cannot be used."""
        component = channel.partition(".")[0]
        late = "its values came too late, or not at all"
        known = channel in self.samples.columns
        return self.samples.problems.get(component) or (late if known else self.samples.why_none)

    def column(self, channel: str) -> list[float] | None:
        """Return a channel's values, a missing one as the one before.

        `None` where more than a tenth is missing.
        """
        column = self.samples.columns.get(channel, ())
        known = [value for value in column if value is not None and isfinite(value)]
        if not known or len(known) < 0.9 * len(column):
            return None
        last, filled = known[0], []
        for value in column:
            last = last if value is None or not isfinite(value) else value
            filled.append(last)
        return filled
