"""What a robot's feed tells: small frozen facts, handed from the network's thread to whoever shows them."""

from dataclasses import dataclass

from gateway.client import Batch, ConnectionState
from gateway.messages import Description, ParameterValues, ResourceSnapshot, Snapshot, Stopped, Written

STOP = "STOP"  # what a stop that failed is called


@dataclass(frozen=True, slots=True)
class LinkChanged:
    """The link went up or down; `problem` says why it is not up."""

    state: ConnectionState
    problem: str | None
    at_ns: int


@dataclass(frozen=True, slots=True)
class Described:
    """What the robot is made of; comes anew with every link."""

    description: Description


@dataclass(frozen=True, slots=True)
class Telemetry:
    """A batch of the stream; `age_ns` is how old its newest row was on arrival, None where nobody knows."""

    batch: Batch
    age_ns: int | None


@dataclass(frozen=True, slots=True)
class Looked:
    """Quality of the components, and the parameters, as they were at `at_ns`."""

    quality: Snapshot
    parameters: ParameterValues | None
    at_ns: int


@dataclass(frozen=True, slots=True)
class Resources:
    """CPU, memory and processes at `at_ns`, and the round trip to the robot."""

    snapshot: ResourceSnapshot
    round_trip_ns: int | None
    at_ns: int


@dataclass(frozen=True, slots=True)
class Changed:
    """A write was done and read back."""

    written: Written


@dataclass(frozen=True, slots=True)
class StopAnswered:
    """What the drives said to a stop."""

    stopped: Stopped


@dataclass(frozen=True, slots=True)
class Failed:
    """Something that was asked for did not happen, in words."""

    what: str
    reason: str


Event = LinkChanged | Described | Telemetry | Looked | Resources | Changed | StopAnswered | Failed
