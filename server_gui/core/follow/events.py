"""Events of a robot's feed: small frozen facts, handed from the network's thread to their consumers."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import msgspec

from gateway.client import Batch, ClockOffset, ConnectionState
from gateway.wire.bus import BusInfo
from gateway.wire.component import Snapshot
from gateway.wire.control import JournalEntries, SignedHead
from gateway.wire.cost import GatewayCost
from gateway.wire.parameter import ParameterValues
from gateway.wire.resource import ProcessUse, ResourceSnapshot
from gateway.wire.robot import Description, Hello


@dataclass(frozen=True, slots=True)
class LinkChanged:
    """The link went up or down; `problem` says why it is not up."""

    state: ConnectionState
    problem: str | None
    at_ns: int
    is_another: bool = False  # what answers has another key than the robot that was paired


@dataclass(frozen=True, slots=True)
class Described:
    """The robot's description; new with every link."""

    description: Description
    calendar_ns: int = 0  # the robot's minus ours when it came
    hello: Hello | None = None  # who we are there


@dataclass(frozen=True, slots=True)
class Telemetry:
    """A batch of a stream, and what the robot's clock is to ours, None where nobody knows."""

    stream: int
    batch: Batch
    clock: ClockOffset | None
    asked_hz: float = 0.0  # rows that were asked for a second; 0: each source's own

    @property
    def age_ns(self) -> int | None:
        """Age of the newest row on arrival, None if unknown."""
        if self.clock is None or not self.batch.stamps_ns:
            return None
        return max(0, self.batch.received_ns + self.clock.offset_ns - self.batch.stamps_ns[-1])


@dataclass(frozen=True, slots=True)
class Looked:
    """Quality of the components, and the parameters, as they were at `at_ns`."""

    quality: Snapshot
    parameters: ParameterValues | None
    at_ns: int


@dataclass(frozen=True, slots=True)
class Resources:
    """CPU, memory and processes at `at_ns`, the round trip to the robot, and all bytes that it has sent."""

    snapshot: ResourceSnapshot
    round_trip_ns: int | None
    at_ns: int
    received_bytes: int = 0
    most: ProcessUse | None = None  # who uses most CPU, where the table itself is left out


@dataclass(frozen=True, slots=True)
class BusesSeen:
    """The robot's buses as they were at `at_ns`; None: its gateway is too old to tell."""

    buses: tuple[BusInfo, ...] | None
    at_ns: int


@dataclass(frozen=True, slots=True)
class Journalled:
    """The newest entries of the robot's journal, oldest first; most have come before.

    `head` is one of them as the robot has signed it, where it has a key.
    """

    journal: JournalEntries
    head: SignedHead | None = None


@dataclass(frozen=True, slots=True)
class Costs:
    """Cost of monitoring on the robot, client by client."""

    cost: GatewayCost


@dataclass(frozen=True, slots=True)
class Failed:
    """Something that was asked for did not happen, in words."""

    what: str
    reason: str


@dataclass(frozen=True, slots=True)
class Refused(Failed):
    """The robot sent what cannot be kept: it was told to nobody."""


@dataclass(frozen=True, slots=True)
class Identified:
    """Identity of each device, by component and by object's address."""

    devices: Mapping[str, Mapping[str, str]]


Event = (
    LinkChanged
    | Described
    | Identified
    | Telemetry
    | Looked
    | Resources
    | Costs
    | BusesSeen
    | Journalled
    | Failed
)


def replaced(event: Telemetry, stamps_ns: list[int], columns: dict[str, list[float | None]]) -> Telemetry:
    """Return the same, with other rows."""
    return dataclasses.replace(
        event, batch=dataclasses.replace(event.batch, stamps_ns=stamps_ns, columns=columns)
    )


def without_processes(event: Event) -> Event:
    """Return the same, of the table of processes only who uses most."""
    if not isinstance(event, Resources):
        return event
    table = event.snapshot.processes
    most = max(table, key=lambda one: one.cpu_percent or 0.0, default=None) if table else None
    left = msgspec.structs.replace(event.snapshot, processes=msgspec.UNSET)
    return dataclasses.replace(event, snapshot=left, most=most)
