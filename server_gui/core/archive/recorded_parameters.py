"""Parameters of a robot during a recording: as they were at its start, and as its journal tells since."""

import bisect
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from gateway.wire.parameter import ParameterInfo, ParameterValue
from ml.store.sessions import OBJECT
from server_gui.core.cloud.tape import Tape
from server_gui.core.recording.batching import EventKind

AFTER: Final = frozenset({"write done", "trial begun"})
BEFORE: Final = frozenset({"taken back", "write taken back"})
UNKNOWN: Final = frozenset({"ROLL-BACK FAILED", "NOT TAKEN BACK yet", "claimed by the stop"})
RECORDED: Final = "a recording"  # why it cannot be written

Values = Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class Turn:
    """What parameters were from an instant on (UTC); None where nobody can say."""

    at_ns: int
    values: Values


class RecordedParameters:
    """Nothing is known before `open`; `told` says whether the journal of that time is known, and whole."""

    def __init__(self) -> None:
        self.described: list[ParameterInfo] = []  # those of which the recording tells object and unit
        self.told = False
        self._start: Values = {}
        self._turns: list[Turn] = []
        self._is_broken = False  # entries of the journal were never seen

    def open(self, tape: Tape) -> None:
        """Take what was recorded at the start of a session."""
        self._start = {
            name: float(value)
            for name, value in tape.session.parameters.items()
            if isinstance(value, int | float)
        }
        self._turns, self.told = [], False
        self._is_broken = any(event.get("kind") == EventKind.JOURNAL_GAP.value for event in tape.events)
        self.described = [
            _info(key.removeprefix(OBJECT), str(said))
            for key, said in tape.session.setup.items()
            if key.startswith(OBJECT)
        ]

    def tell(self, entries: Iterable[Mapping[str, Any]], begin_ns: int, end_ns: int) -> None:
        """Take the robot's journal of the time of the recording, as far as it was collected."""
        within = (one for one in entries if isinstance(one.get("utc_ns"), int))
        self._turns = sorted(
            _turns(one for one in within if begin_ns <= one["utc_ns"] <= end_ns), key=lambda turn: turn.at_ns
        )
        self.told = not self._is_broken

    def at(self, utc_ns: int) -> dict[str, ParameterValue]:
        """Return the values at an instant; what is not known is not among them."""
        held = dict(self._start)
        for turn in self._turns[: bisect.bisect_right(self._turns, utc_ns, key=lambda turn: turn.at_ns)]:
            held.update(turn.values)
        units = {info.name: info.unit for info in self.described}
        return {
            name: ParameterValue(value, units.get(name, ""), None, None, None)
            for name, value in held.items()
            if value is not None
        }


def _turns(entries: Iterable[Mapping[str, Any]]) -> Iterator[Turn]:
    asked: dict[object, tuple[Values, Values]] = {}  # by the number of a write: before, after
    for entry in entries:
        what, number, at_ns = str(entry.get("what")), entry.get("write"), entry["utc_ns"]
        if what == "write":
            asked[number] = _values(entry.get("before")), _values(entry.get("after"))
            yield Turn(at_ns, dict.fromkeys(asked[number][1]))  # not known until it says how it ended
        elif what in AFTER:
            yield Turn(at_ns, _values(entry.get("after")))
        elif what in BEFORE and number in asked:
            yield Turn(at_ns, asked[number][0])
        elif what in UNKNOWN and number in asked:
            yield Turn(at_ns, dict.fromkeys(asked[number][1]))


def _values(said: object) -> Values:
    known = said if isinstance(said, Mapping) else {}
    return {str(name): float(one) if isinstance(one, int | float) else None for name, one in known.items()}


def _info(name: str, said: str) -> ParameterInfo:
    place, _, unit = said.partition(" ")
    component = name.partition(".")[0]
    return ParameterInfo(
        name,
        unit,
        None,
        None,
        None,
        live=False,
        states=None,
        component=component,
        object=place,
        access="ro",
        store=False,
        read_only=RECORDED,
    )
