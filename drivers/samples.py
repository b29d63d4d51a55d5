"""The drivers' output: channels, samples, quality. SI units, robot's monotonic time."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum


class ComponentState(StrEnum):
    """Trust in a component's values."""

    OK = "ok"
    STALE = "stale"  # silent for longer than stale_after_s: values are null
    LOST = "lost"  # silent for longer than lost_after_s, or not there at all
    FAULT = "fault"  # it talks, and says that it is in fault, or what it says cannot be believed


@dataclass(frozen=True, slots=True)
class Channel:
    """One named quantity of one component, in one unit."""

    name: str  # component.quantity, unique on the robot
    component: str
    quantity: str
    unit: str  # SI symbol, "" for a pure number, "°C" for temperatures
    enum: Mapping[int, str] | None = None  # words for a state's numbers


@dataclass(frozen=True, slots=True)
class Sample:
    """Values of one component that were received together.

    `indices` are positions in the component's `channels`; `values` stand in the same order, `None`
    where the device said that it has no value. `stamp_ns` is on the robot's monotonic
    clock: when it was received, or when it was taken where the device's own clock tells.
    """

    component: str
    stamp_ns: int
    indices: tuple[int, ...]
    values: tuple[float | None, ...]


@dataclass(frozen=True, slots=True)
class Finding:
    """A problem in words: since when (monotonic clock), and what to check."""

    since_ns: int
    words: str
    check: str

    def text(self, now_ns: int) -> str:
        """Return the finding as in `it hangs (for 3 s): check its power`."""
        return f"{self.words} (for {max(0, now_ns - self.since_ns) / 1e9:.0f} s): {self.check}"


@dataclass(frozen=True, slots=True)
class Quality:
    """Present quality of a component."""

    state: ComponentState
    age_ms: float | None  # since its last sample; None before the first
    problem: str | None = None  # in words, with what to check
    counters: Mapping[str, int] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()  # of what `problem` says, that which has a beginning
