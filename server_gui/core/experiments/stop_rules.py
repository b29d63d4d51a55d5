"""Stop rules of an experiment: the conditions that end it, in words. Nothing here queries the robot."""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import Kind
from server_gui.core.experiments.plan import Bounds
from server_gui.core.follow.events import Described, Event, Journalled, Looked, Telemetry

AS_USUAL: Final = 2.0  # times the largest that was seen before: a bound where none was given
SETTLES_NS: Final = 1_500_000_000  # after which what was read is what was written
GUARD: Final = "guard"
# What a busy computer has for a moment, and the robot withstands: these count once they last.
PASSING: Final = frozenset({Kind.PART_STALE, Kind.STALLED})
PASSES_NS: Final = 2_000_000_000
# Not of the robot's state, or looked at elsewhere: rows that do not come have a rule of their own (`STALE_S`
# of a run), and what a troubled bus has lost is left out with its strides.
NO_REASON: Final = frozenset(
    {
        Kind.STALE,
        Kind.BUS,
        Kind.BUS_BUSY,
        Kind.NOT_RECORDED,
        Kind.RECORDING,
        Kind.UPLOAD,
        Kind.DANGER_ADVICE,  # a changed parameter is unusual; from the level alarm on it counts
    }
)
ENDING: Final = {
    "stop": "somebody has sent a STOP",
    "stop still held": "a stop is held",
    "taken back": "the robot has taken the trial back",
    "claimed by the stop": "a stop has taken the trial over",
    "write taken back": "the robot has taken the write back",
    "ROLL-BACK FAILED": "the robot could not take the write back",
}
ASKED: Final = {
    "following_error": "Most tracking error in the form, --most-error",
    "current": "Most current in the form, --most-current",
}
OF_OTHERS: Final = {"write": "a write", "restore": "a restore", "store": "a store", "enable": "an enabling"}


@dataclass(slots=True)
class StopRules:
    """Takes what the robot tells; `why` is the first rule that was broken, None while none is.

    `name` is the parameter, `joints` those whose tracking error and current count. Before `begin` it only
    learns what is usual.
    """

    name: str
    joints: tuple[str, ...]
    bounds: Bounds
    said: Callable[[float], str] = "{:g}".format  # a value of it, for people
    why: str | None = None
    who: str = ""  # we, as the robot's journal calls us; empty until it tells of our first write
    most: dict[str, float] = field(default_factory=dict)  # by quantity, before the beginning
    _usual: Collection[str] = ()  # quantities whose bound is twice what was usual
    _alarms: frozenset[object] = frozenset()
    _lasting: dict[object, int] = field(default_factory=dict)  # since when, on our clock
    _begun: bool = False
    _entry: int = 0  # of the journal: the newest that is known
    _boot_id: str | None = None
    _began_ns: int = 0  # the robot's clock: what its journal tells of before is no news
    _value: float | None = None  # that the device holds
    _since_ns: int = 0  # our clock
    _differs: int = 0

    def begin(self, alarms: Iterable[Alarm], robot_ns: int) -> Bounds:
        """Begin to watch, now on the robot's clock; the bounds: twice what is usual, where none was given."""
        self._begun, self._began_ns = True, robot_ns
        self._alarms = frozenset(alarm.key for alarm in alarms)
        usual = {name: AS_USUAL * most for name, most in self.most.items() if most > 0.0}
        bounds = {"following_error": self.bounds.error, "current": self.bounds.current}
        given = {name: bound for name, bound in bounds.items() if bound is not None}
        self._usual = usual.keys() - given.keys()
        found = usual | given
        self.bounds = Bounds(found.get("following_error"), found.get("current"))
        return self.bounds

    def writes(self) -> None:
        """Note that we are about to write a value."""
        self._value = None

    def holds(self, value: float, now_ns: int) -> None:
        """Take the value read back by the robot; `now_ns` is our clock."""
        self._value, self._since_ns, self._differs = value, now_ns, 0

    def take(self, event: Event) -> None:
        """Take one fact."""
        for why in self._broken(event):
            self._ends(why)

    def see(self, alarms: Iterable[Alarm], now_ns: int) -> None:
        """Look at the alarms of now (our clock): what was not there at the beginning ends it."""
        if not self._begun:
            return
        new = [one for one in alarms if one.key not in self._alarms and one.kind not in NO_REASON]
        self._lasting = {one.key: self._lasting.get(one.key, now_ns) for one in new}
        for alarm in new:
            if alarm.kind not in PASSING or now_ns - self._lasting[alarm.key] >= PASSES_NS:
                self._ends(alarm.brief)

    def _ends(self, why: str) -> None:
        if self._begun and self.why is None:
            self.why = why

    def _broken(self, event: Event) -> Iterator[str]:
        match event:
            case Telemetry():
                yield from self._beyond(event)
            case Journalled():
                yield from self._told(event.journal.entries)
            case Looked():
                yield from self._held(event)
            case Described():
                known, self._boot_id = self._boot_id, event.description.boot_id
                if known not in (None, self._boot_id):
                    yield "the robot's computer has started anew"
                if event.description.stop.held:
                    yield "a stop is held"

    def _beyond(self, event: Telemetry) -> Iterator[str]:
        columns = event.batch.columns
        limits = {"following_error": self.bounds.error, "current": self.bounds.current}
        for quantity, limit in limits.items():
            for joint in self.joints:
                found = max(_sizes(columns.get(f"{joint}.{quantity}", ())), default=0.0)
                if not self._begun:
                    self.most[quantity] = max(found, self.most.get(quantity, 0.0))
                elif limit is not None and found > limit:
                    yield f"{joint}: {_over(quantity, found, limit)}{self._allowed(quantity)}"

    def _allowed(self, quantity: str) -> str:
        """Return the way to relax a default bound; empty for a bound that was chosen."""
        if quantity not in self._usual:
            return ""
        return (
            f" (twice what was usual); if that much is harmless allow it: {ASKED[quantity]}, or nearer values"
        )

    def _told(self, entries: Sequence[Mapping[str, Any]]) -> Iterator[str]:
        numbers = [number for entry in entries if isinstance(number := entry.get("n"), int)]
        if numbers and max(numbers) < self._entry:
            self._entry = 0  # it was begun anew: nothing of it is known
        for entry in entries:
            number = entry.get("n")
            if not isinstance(number, int) or number <= self._entry:
                continue
            self._entry = number
            at_ns = entry.get("monotonic_ns")
            if not isinstance(at_ns, int) or at_ns > self._began_ns:
                yield from self._meant(entry, str(entry.get("what")))

    def _meant(self, entry: Mapping[str, Any], what: str) -> Iterator[str]:
        if entry.get("who") == GUARD:
            yield f"the guard: {what}, {entry.get('reason') or entry.get('about') or ''}"
        elif what in ENDING:
            yield f"{ENDING[what]} ({entry.get('who')})"
        elif what in OF_OTHERS and self._is_ours(entry):
            self.who = str(entry.get("who") or "")
        elif what in OF_OTHERS:
            yield f"{OF_OTHERS[what]} of another: {entry.get('who')}"

    def _is_ours(self, entry: Mapping[str, Any]) -> bool:
        """We have the lease: a trial of just this parameter can be nobody else's."""
        after = entry.get("after")
        return isinstance(after, Mapping) and list(after) == [self.name] and entry.get("trial_s") is not None

    def _held(self, event: Looked) -> Iterator[str]:
        """Two looks in a row: one may have been under way when it was written."""
        known = None if event.parameters is None else event.parameters.values.get(self.name)
        if self._value is None or known is None or event.at_ns < self._since_ns + SETTLES_NS:
            return
        if known.value is None:
            self._differs += 1
            problem = (known.problem or "").removeprefix(f"{self.name}: ")
            found = f"{self.name} cannot be read: {problem}"
        elif known.value == self._value:
            self._differs = 0
            return
        else:
            self._differs += 1
            held, ours = self.said(known.value), self.said(self._value)
            found = f"{self.name} is {held} and not {ours}: somebody else has written it"
        if self._differs > 1:
            yield found


def _over(quantity: str, found: float, limit: float) -> str:
    """In both units of an angle: the window and the terminal tell it alike."""
    if quantity != "following_error":
        return f"{quantity} {found:.3g} A, beyond the bound of {limit:.3g} A"
    said = [f"{value:.3g} rad ({math.degrees(value):.2g}°)" for value in (found, limit)]
    return "tracking error {}, beyond the bound of {}".format(*said)


def _sizes(values: Iterable[float | None]) -> Iterator[float]:
    return (abs(value) for value in values if value is not None)
