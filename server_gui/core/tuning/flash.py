"""Presence of a value in a device's flash: by the journal only; a drive cannot be asked."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from gateway.client import ClockOffset
from gateway.several_joints import devices
from gateway.wire.component import QualityInfo
from gateway.wire.method import Number
from gateway.wire.robot import Description
from server_gui.core.audit.journal import Audit

Entry = Mapping[str, Any]
Device = tuple[object, object]  # bus and node id, or what stands for a device without them

_LIFE: Final = ("boots", "bus_opened", "bus_dropped")  # counters that show that a boot-up was, or was missed
_RULE: Final = "yes only where the journal shows it: stored after its last write, and no boot-up since"
RULE: Final = f"{_RULE}. Else unknown, because a drive cannot be asked"


@dataclass(frozen=True, slots=True)
class Claim:
    """A value that was stored, and when, on the robot's clock of that boot."""

    value: Number
    stamp_ns: int
    boot_id: str


def claims(entries: Iterable[Entry], device_of: Mapping[str, Device]) -> dict[str, Claim]:
    """Return each parameter's last write, and whether it was stored since, of entries without a hole."""
    reading = _Reading(device_of)
    for entry in entries:
        effect = _EFFECTS.get(str(entry.get("what")))
        if effect is not None:
            effect(reading, entry)
    return reading.claims


class _Reading:
    """Values that were written last, and which of them were stored then."""

    def __init__(self, device_of: Mapping[str, Device]) -> None:
        self.claims: dict[str, Claim] = {}
        self._device_of = device_of
        self._values: dict[str, Number] = {}
        self._writes: dict[Any, Mapping[str, Number]] = {}  # write → what it wrote

    def begun(self, entry: Entry) -> None:
        """Note that nobody knows from now on, until the journal says how it ended."""
        after = entry.get("after")
        self._writes[entry.get("write")] = after if isinstance(after, Mapping) else {}
        self._forget(self._writes[entry.get("write")])

    def done(self, entry: Entry) -> None:
        self._values |= self._writes.get(entry.get("write"), {})

    def taken_back(self, entry: Entry) -> None:
        outcome = entry.get("outcome")
        self._forget(outcome if isinstance(outcome, Mapping) else {})

    def stored(self, entry: Entry) -> None:
        for name in self._of_device(entry, self._values):
            stamp_ns, boot_id = int(entry.get("monotonic_ns") or 0), str(entry.get("boot_id"))
            self.claims[name] = Claim(self._values[name], stamp_ns, boot_id)

    def storing(self, entry: Entry) -> None:
        """Forget the memory's content while it is written, and after a failure."""
        for name in self._of_device(entry, self.claims):
            del self.claims[name]

    def _of_device(self, entry: Entry, names: Iterable[str]) -> list[str]:
        wanted = self._device_of.get(str(entry.get("component")))
        return [name for name in names if self._device_of.get(name.partition(".")[0]) == wanted]

    def _forget(self, names: Iterable[str]) -> None:
        for name in names:
            self._values.pop(name, None)
            self.claims.pop(name, None)


_EFFECTS: Final[Mapping[str, Callable[[_Reading, Entry], None]]] = {
    "write": _Reading.begun,
    "write done": _Reading.done,
    "trial confirmed": _Reading.done,
    "taken back": _Reading.taken_back,
    "NOT TAKEN BACK yet": _Reading.taken_back,
    "write taken back": _Reading.taken_back,
    "claimed by the stop": _Reading.taken_back,
    "ROLL-BACK FAILED": _Reading.taken_back,
    "store": _Reading.storing,
    "store done": _Reading.stored,
    "store FAILED": _Reading.storing,
    "restore": _Reading.storing,
    "restore FAILED": _Reading.storing,
    "restore done": _Reading.storing,
}


class Flash:
    """Stored parameters of a robot, as far as known.

    Looks at its components tell since when, on our clock, each device is seen without a boot-up; one that is
    not seen may have had one.
    """

    def __init__(self, audit: Audit) -> None:
        self.clock: ClockOffset | None = None  # the robot's
        self._audit = audit
        self._claims: dict[str, Claim] = {}
        self._claimed: tuple[int, Description | None] = (0, None)  # what they are of
        self._since: dict[str, tuple[tuple[object, ...], int]] = {}

    def look(self, quality: Mapping[str, QualityInfo], at_ns: int) -> None:
        """Take a look at every component."""
        for name, found in quality.items():
            life = tuple(found.get(key) for key in _LIFE)
            if None in life or found.get("state") == "lost":
                self._since.pop(name, None)
            elif name not in self._since or self._since[name][0] != life:
                self._since[name] = life, at_ns

    def forget(self) -> None:
        """Forget the values after a drop of the link."""
        self._since.clear()

    def holds(self, name: str, value: Number, description: Description) -> bool:
        """Return whether this value is stored; False is *unknown*."""
        if self._claimed != (self._audit.revision, description):
            self._claimed = self._audit.revision, description
            self._claims = claims(self._audit.unbroken(), devices(description))
        claim, seen = self._claims.get(name), self._since.get(name.partition(".")[0])
        if claim is None or seen is None or self.clock is None:
            return False
        quiet_ns = seen[1] + self.clock.offset_ns + self.clock.uncertainty_ns  # on the robot's clock
        same = claim.value == value and claim.boot_id == description.boot_id
        return same and quiet_ns <= claim.stamp_ns
