"""What has happened on the axis of time: stops, faults, buses, writes, marks; live or of a recording."""

import bisect
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final, cast

from drivers.error_codes import code_in, error_text
from gateway.units import Unit, Units, with_minus
from gateway.wire.parameter import ParameterInfo
from ml.store.labels import utc_ns
from server_gui.core.recording.batching import EventKind
from server_gui.core.tuning.edits import spoken

Entry = Mapping[str, Any]
KEPT: Final = 500
SOON_NS: Final = 1_000_000_000  # after a fault: then its code is of it
ASKED_FOR: Final = "asked for"  # with no word of by whom
TAKEN_BACK: Final = "taken back"  # as the robot's journal has it
WINDOW: Final = re.compile(r"gwrms gui \((.+):\d+\)")
HERE: Final = frozenset({"127.0.0.1", "[::1]", "::1"})
JUST_BEFORE_NS: Final = 200_000_000  # flags of one kind and text so near each other are one


NOTICED_NS: Final = 2_000_000_000  # so long a fault is noticed after its row at most


class FlagKind(Enum):
    """What sort of thing happened; the word is shown."""

    STOP = "stop"
    UNPROVEN = "stop not confirmed"  # that this window has sent
    FAULT = "fault"
    WRITE = "write"
    TRIAL = "trial"
    MARK = "mark"
    DANGER = "danger"  # advice or worse is foreseen, or is over
    BUS = "bus"  # it fails, is full, or lacks what nodes send
    GAP = "gap"  # of a recording: something of it is missing
    CHANGE = "change"  # of what it was recorded with: a clock, a name, a model that was learned
    RULE = "rule"  # on predictions: it began or ceased to hold, or what came of its stop
    TRIGGER = "trigger"  # of the signals, and nowhere else


@dataclass(frozen=True, slots=True, order=True)
class Flag:
    """One thing that happened at `at_ns`, on the clock of the axis that it stands on."""

    at_ns: int
    text: str
    kind: FlagKind


class Flags:
    """The newest `KEPT` of one axis, in the order of time; `revision` rises with each change."""

    def __init__(self) -> None:
        self._flags: list[Flag] = []
        self.revision = 0

    def __iter__(self) -> Iterator[Flag]:
        return iter(self._flags)

    def __len__(self) -> int:
        return len(self._flags)

    def add(self, *flags: Flag) -> None:
        """Add these; one that is known already, or follows its like at once, is not added again."""
        for flag in flags:
            if any(_same(flag, known) for known in self.between(flag.at_ns - JUST_BEFORE_NS, flag.at_ns + 1)):
                continue
            bisect.insort(self._flags, flag, key=_at)
            del self._flags[:-KEPT]
            self.revision += 1

    def between(self, begin_ns: int, end_ns: int) -> Sequence[Flag]:
        """Return those from one instant up to before another."""
        first = bisect.bisect_left(self._flags, begin_ns, key=_at)
        return self._flags[first : bisect.bisect_left(self._flags, end_ns, key=_at)]

    def instant_of_fault(self, component: str, at_ns: int) -> int:
        """Return when a component fell into the fault that was noticed at this instant; that where not known.

        What is noticed is later than what the rows show.
        """
        spoken = component.replace("_", " ")
        near = self.between(at_ns - NOTICED_NS, at_ns + NOTICED_NS)
        known = [one.at_ns for one in near if one.kind is FlagKind.FAULT and spoken in _names(one.text)]
        return min(known, key=lambda found: (found > at_ns, abs(found - at_ns)), default=at_ns)

    def clear(self) -> None:
        """Forget them: the clock has begun anew."""
        self._flags.clear()
        self.revision += 1


class StateWatch:
    """Finds in rows where drives fall into a fault, or are stopped; remembers each drive's last state.

    Drives that do so in one row are one flag. `words` are those of the channels that are states: what
    `robot.describe` tells of them.
    """

    def __init__(self) -> None:
        self._last: dict[str, float] = {}

    def take(
        self,
        stamps_ns: Sequence[int],
        columns: Mapping[str, Sequence[float | None]],
        words: Mapping[str, Mapping[str, str]],
    ) -> Iterator[Flag]:
        """Yield what these rows bring; of a fault its code, where a row tells that soon."""
        found: dict[tuple[int, FlagKind, str], list[str]] = {}
        for channel in columns.keys() & words.keys():
            if channel.endswith(".state"):
                for at_ns, kind in self._turns(stamps_ns, channel, columns[channel], words[channel]):
                    codes = columns.get(code_of(channel), ()) if kind is FlagKind.FAULT else ()
                    found.setdefault((at_ns, kind, _code(stamps_ns, codes, at_ns)), []).append(
                        _spoken(channel)
                    )
        for (at_ns, kind, code), joints in sorted(found.items(), key=lambda item: item[0][0]):
            yield Flag(at_ns, f"{', '.join(sorted(joints))}: {_HOW[kind]}{code}", kind)

    def _turns(
        self,
        stamps_ns: Sequence[int],
        channel: str,
        column: Sequence[float | None],
        words: Mapping[str, str],
    ) -> Iterator[tuple[int, FlagKind]]:
        before = self._last.get(channel)
        if before is not None and column.count(before) == len(column):
            return  # as nearly always
        for at_ns, value in zip(stamps_ns, column, strict=True):
            if value is None or value != value or value == before:
                continue
            kind = _kind(words.get(str(int(value)), ""))
            was = None if before is None else _kind(words.get(str(int(before)), ""))
            if kind is not None and kind is not was and before is not None:
                yield at_ns, kind
            before = self._last[channel] = value


def of_journal(
    entries: Iterable[Entry], boot_id: str, described: Iterable[ParameterInfo] = ()
) -> Iterator[Flag]:
    """Yield what a robot's journal tells of one boot, on the robot's clock."""
    units = _units(described)
    for entry in entries:
        if entry.get("boot_id") == boot_id:
            yield from _of_entry(entry, "monotonic_ns", units)


def of_recorded_journal(entries: Iterable[Entry], described: Iterable[ParameterInfo] = ()) -> Iterator[Flag]:
    """Yield what a recorded journal tells, in UTC."""
    units = _units(described)
    for entry in entries:
        yield from _of_entry(entry, "utc_ns", units)


def of_events(events: Iterable[Entry]) -> Iterator[Flag]:
    """Yield what the events of a recording tell, in UTC; what is of no known kind tells what is missing."""
    for event in events:
        kind = _TOLD.get(str(event.get("kind")), FlagKind.GAP)
        yield Flag(utc_ns(event["utc"]), str(event.get("text") or kind.value), kind)


def _units(described: Iterable[ParameterInfo]) -> dict[str, Unit]:
    """Return the units that these parameters are shown in, by their names."""
    known = Units()
    return {info.name: known.unit(info.name.rpartition(".")[2], info.unit) for info in described}


def _of_entry(entry: Entry, clock: str, units: Mapping[str, Unit]) -> Iterator[Flag]:
    kind, at_ns = _ENTRIES.get(str(entry.get("what"))), entry.get(clock)
    if kind is not None and isinstance(at_ns, int):
        trial = kind is FlagKind.WRITE and entry.get("trial_s") is not None
        yield Flag(at_ns, _said(entry, units), FlagKind.TRIAL if trial else kind)


def _said(entry: Entry, units: Mapping[str, Unit]) -> str:
    """Return who did what, and why: the parameters of a write, the reason of a stop."""
    after, what, who = entry.get("after"), str(entry.get("what")), entry.get("who")
    before = entry.get("before")
    was = before if isinstance(before, Mapping) else {}
    about = (
        ", ".join(_changed(str(name), was.get(name), after[name], units) for name in after)
        if isinstance(after, Mapping)
        else ""
    )
    why = "" if about else str(entry.get("reason") or "")
    if why == ASKED_FOR:
        return f"{what} on request"
    by = "" if what == TAKEN_BACK or not who else _by(str(who))  # by itself, whoever has asked for it
    return ": ".join(filter(None, (" ".join(filter(None, (what, about, by))), why)))


def _changed(name: str, before: object, after: object, units: Mapping[str, Unit]) -> str:
    """Return a parameter with its old and its new value, as far as these are numbers or words.

    In its unit, by the name for people, where that is known.
    """
    unit = units.get(name)
    told = [_value(value, unit) for value in (before, after)]
    if unit is None:
        return name if before is None else f"{name} {told[0]} → {told[1]}"
    return spoken(name) if before is None else f"{spoken(name)} {told[0]} → {told[1]} {unit.symbol}".rstrip()


def _value(value: object, unit: Unit | None) -> str:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if unit is not None and is_number:
        return with_minus(unit.editable(float(cast("float", value))))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _by(who: str) -> str:
    """Return who did it; a window's port tells people nothing."""
    window = WINDOW.fullmatch(who)
    if window is None:
        return f"by {who}"
    return "from the window" if window[1] in HERE else f"from the window on {window[1]}"


def fault_codes(flags: Iterable[Flag]) -> dict[str, int]:
    """Return the code of the newest fault of each component, by its name for people; 0 where none is told."""
    codes: dict[str, int] = {}
    for one in flags:
        if one.kind is FlagKind.FAULT:
            codes |= dict.fromkeys(_names(one.text), code_in(one.text) or 0)
    return codes


def code_of(channel: str) -> str:
    """Return the channel of a drive's error code, by that of its state."""
    return f"{channel.removesuffix('.state')}.error_code"


def _code(stamps_ns: Sequence[int], codes: Sequence[float | None], at_ns: int) -> str:
    """Return the first error code from an instant on, in words; a drive may tell it a little later."""
    soon = (
        code for stamp_ns, code in zip(stamps_ns, codes, strict=False) if 0 <= stamp_ns - at_ns <= SOON_NS
    )
    code = next((int(code) for code in soon if code and code == code), None)
    return "" if code is None else f" {error_text(code)}"


def _kind(word: str) -> FlagKind | None:
    if "fault" in word.lower():
        return FlagKind.FAULT
    return FlagKind.STOP if "quick stop" in word.lower() else None


def _names(text: str) -> list[str]:
    """Return whom a flag names, as a fault does: `left hip, left knee: fault`."""
    return text.partition(": ")[0].split(", ")


def _spoken(channel: str) -> str:
    return channel.rpartition(".")[0].replace("_", " ")


def _same(flag: Flag, known: Flag) -> bool:
    return (flag.kind, flag.text) == (known.kind, known.text)


def _at(flag: Flag) -> int:
    return flag.at_ns


_TOLD: Final = {
    EventKind.MARKER.value: FlagKind.MARK,
    EventKind.DANGER.value: FlagKind.DANGER,
    EventKind.RULE.value: FlagKind.RULE,
    EventKind.BUS.value: FlagKind.BUS,
    EventKind.NAME.value: FlagKind.CHANGE,
    EventKind.CLOCK_STEP.value: FlagKind.CHANGE,
    EventKind.ADAPTED.value: FlagKind.CHANGE,
    EventKind.FORGOTTEN.value: FlagKind.CHANGE,
}
_HOW: Final = {FlagKind.FAULT: "fault", FlagKind.STOP: "quick stop"}
_ENTRIES: Final = {
    "stop": FlagKind.STOP,
    "write": FlagKind.WRITE,
    "trial confirmed": FlagKind.TRIAL,
    TAKEN_BACK: FlagKind.TRIAL,
}
