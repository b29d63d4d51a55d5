"""Edits of a robot's parameters, as its journal tells them: who, what from and to, when it was in force."""

import datetime
import logging
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from typing import Any, Final

from msgspec import Struct
from msgspec.structs import replace

from gateway.amounts import NONE
from server_gui.core.evidence.comparison import Spell

log = logging.getLogger(__name__)

Entry = Mapping[str, Any]

SETTLE_NS: Final = 1_000_000_000  # after a write: what the robot does until then belongs to neither side
BEFORE_NS: Final = 120_000_000_000  # of walking before an edit
AFTER_NS: Final = 120_000_000_000  # with the new values
BACK_NS: Final = 60_000_000_000  # after they were taken back
TRIAL_NS: Final = 300_000_000_000  # the longest trial that a robot takes
BACK: Final = "taken back"  # as it is called wherever it is shown; files of evidence say `reverted`
ID: Final = 10  # digits of the hash of the journal's entry


class EditState(StrEnum):
    """State of an edit."""

    ASKED = "NOT KNOWN how it ended"
    ON_TRIAL = "on trial"
    KEPT = "kept"
    REVERTED = "reverted"
    TAKEN_OVER = "taken over by another trial"
    FAILED = "failed"  # it was never in force as a whole


class ParameterChange(Struct, frozen=True):
    """One parameter; SI."""

    name: str
    old: float | None
    new: float


class Edit(Struct, frozen=True):
    """One write of one or more parameters; stamps are on the robot's monotonic clock, of `boot_id`.

    `id` is the beginning of the hash of the entry in the robot's journal that asked for it (`n` is its number
    there). New values were in force from `in_force_ns` until `ended_ns`, as far as either is known.
    """

    id: str
    robot: str
    n: int
    write: int
    boot_id: str
    who: str
    utc_ns: int
    changes: tuple[ParameterChange, ...]
    trial_s: float | None
    began_ns: int
    state: EditState = EditState.ASKED
    in_force_ns: int | None = None
    ended_ns: int | None = None
    not_back: tuple[str, ...] = ()  # parameters that its end has left with another value, and why

    @property
    def became(self) -> str:
        """Its result, in words."""
        said = BACK if self.state is EditState.REVERTED else str(self.state)
        return f"{said}, NOT all of it" if self.not_back else said

    @property
    def utc(self) -> str:
        """When, as ISO 8601, UTC."""
        try:
            at = datetime.datetime.fromtimestamp(self.utc_ns // 10**9, datetime.UTC)
        except (OverflowError, ValueError, OSError):  # nobody's calendar has it
            return NONE
        return at.strftime("%Y-%m-%dT%H:%M:%SZ")

    @property
    def components(self) -> frozenset[str]:
        """The edited components."""
        return frozenset(change.name.partition(".")[0] for change in self.changes)

    @property
    def names(self) -> str:
        """Its parameters."""
        return ", ".join(change.name for change in self.changes)


class JournalEdits:
    """The edits of one robot, from its journal's entries as they come; oldest first in `all`."""

    def __init__(self, robot: str) -> None:
        self.all: list[Edit] = []
        self._robot = robot

    def take(self, entries: Iterable[Entry]) -> None:
        """Take new entries, oldest first."""
        for entry in entries:
            try:
                self._take(entry, str(entry.get("what")))
            except (KeyError, TypeError, ValueError, OverflowError) as error:
                log.warning("%s: entry %s of its journal is no edit: %r", self._robot, entry.get("n"), error)

    def forget(self, before_ns: int) -> None:
        """Forget edits that were over long ago, or of which nothing was heard since."""
        self.all = [edit for edit in self.all if _last_ns(edit, before_ns) >= before_ns]

    def lose_sight(self, at_ns: int) -> None:
        """Mark open trials as lost from sight: their end is unknown."""
        self.all = [
            replace(edit, state=EditState.ASKED, ended_ns=at_ns) if edit.state is EditState.ON_TRIAL else edit
            for edit in self.all
        ]

    def _take(self, entry: Entry, what: str) -> None:
        if what == "write":
            begun = _begun(self._robot, entry)
            if all((edit.id, edit.began_ns) != (begun.id, begun.began_ns) for edit in self.all):
                self.all.append(begun)
            return
        outcome = _OUTCOMES.get(what)
        places = [place for place, edit in enumerate(self.all) if edit.write == entry.get("write")]
        if outcome is None or not places:
            return
        edit, stamp_ns = self.all[places[-1]], int(entry["monotonic_ns"])
        in_force_ns = edit.in_force_ns
        if outcome in (EditState.ON_TRIAL, EditState.KEPT) and in_force_ns is None:
            in_force_ns = stamp_ns
        ended_ns = edit.ended_ns  # the first end, where a stop has claimed a part
        if ended_ns is None and outcome in (EditState.REVERTED, EditState.FAILED):
            ended_ns = stamp_ns
        if outcome is EditState.ON_TRIAL:
            self._take_over(edit, stamp_ns)
        not_back = tuple(dict.fromkeys([*edit.not_back, *_not_back(entry)]))
        self.all[places[-1]] = replace(
            edit, state=outcome, in_force_ns=in_force_ns, ended_ns=ended_ns, not_back=not_back
        )

    def _take_over(self, by: Edit, stamp_ns: int) -> None:
        """Another trial of the same parameter is over with this one, of which no entry is written."""
        names = {change.name for change in by.changes}
        for place, edit in enumerate(self.all):
            shares = names & {change.name for change in edit.changes}
            if edit.write != by.write and edit.state is EditState.ON_TRIAL and shares:
                self.all[place] = replace(edit, state=EditState.TAKEN_OVER, ended_ns=stamp_ns)


_OUTCOMES: Final[Mapping[str, EditState]] = {
    "write done": EditState.KEPT,
    "trial begun": EditState.ON_TRIAL,
    "trial confirmed": EditState.KEPT,
    "taken back": EditState.REVERTED,
    "claimed by the stop": EditState.REVERTED,
    "write taken back": EditState.FAILED,
    "ROLL-BACK FAILED": EditState.FAILED,
}


OLD_VALUE: Final = frozenset({"taken back", "unchanged"})  # what a robot says of a parameter that has it


def _not_back(entry: Entry) -> Iterator[str]:
    """Yield parameters that were not reverted: set by a stop, changed by others, or given up."""
    outcome = entry.get("outcome")
    if _OUTCOMES.get(str(entry.get("what"))) is EditState.REVERTED and isinstance(outcome, Mapping):
        yield from (f"{name}: {said}" for name, said in outcome.items() if said not in OLD_VALUE)


def _begun(robot: str, entry: Entry) -> Edit:
    before, after = _numbers(entry.get("before")), _numbers(entry.get("after"))
    trial_s = entry.get("trial_s")
    return Edit(
        id=str(entry["hash"])[:ID],
        robot=robot,
        n=int(entry["n"]),
        write=int(entry.get("write") or 0),
        boot_id=str(entry.get("boot_id")),
        who=str(entry.get("who")),
        utc_ns=int(entry.get("utc_ns") or 0),
        changes=tuple(ParameterChange(name, before.get(name), new) for name, new in after.items()),
        trial_s=float(trial_s) if isinstance(trial_s, int | float) else None,
        began_ns=int(entry["monotonic_ns"]),
    )


def _numbers(found: object) -> dict[str, float]:
    known = found.items() if isinstance(found, Mapping) else ()
    numbers = {str(name): float(value) for name, value in known if isinstance(value, int | float)}
    return {name: value for name, value in numbers.items() if math.isfinite(value)}


def _last_ns(edit: Edit, now_ns: int) -> int:
    if edit.state is EditState.ASKED:
        return edit.began_ns
    until_ns = due_ns(edit)
    return now_ns if until_ns is None else until_ns


def due_ns(edit: Edit) -> int | None:
    """Return until when there may be more to be seen of an edit; None while that is open."""
    if edit.state is EditState.FAILED or edit.in_force_ns is None:
        return edit.ended_ns
    if edit.ended_ns is not None:
        return edit.ended_ns + BACK_NS
    return None if edit.state is EditState.ON_TRIAL else edit.in_force_ns + AFTER_NS


def spell(edit: Edit, edits: Sequence[Edit]) -> tuple[Spell, tuple[str, ...]]:
    """Return when old and new values were in force undisturbed by the other `edits`; and what has disturbed.

    Once an edit was taken back, the walk goes on with the old values: that is another stretch of before,
    which tells a drift from an effect better than anything. It does not where another value came back than
    was there before: that of before a trial which this one has taken over, of a stop, or of somebody else.
    """
    took_over = {other.id for other in edits if _is_taken_over(other, edit)}
    others = [
        (at_ns, other)
        for other in edits
        if other.id != edit.id
        for at_ns in _instants(other)
        if other.id not in took_over or at_ns != edit.in_force_ns
    ]
    began_ns, in_force_ns = edit.began_ns, edit.in_force_ns
    earlier = [at_ns for at_ns, _ in others if at_ns <= began_ns]
    since_ns = max([began_ns - BEFORE_NS, *(at_ns + SETTLE_NS for at_ns in earlier)])
    before = [(since_ns, began_ns)]
    if in_force_ns is None:
        return Spell(before, ()), ()
    later = [at_ns for at_ns, _ in others if at_ns > began_ns]
    ends = [in_force_ns + AFTER_NS, *later, *([edit.ended_ns] if edit.ended_ns is not None else [])]
    after = [(in_force_ns + SETTLE_NS, min(ends))]
    is_as_before = not took_over and not edit.not_back
    if edit.ended_ns is not None and is_as_before and not any(at_ns <= edit.ended_ns for at_ns in later):
        before.append((edit.ended_ns + SETTLE_NS, min([edit.ended_ns + BACK_NS, *later])))
    return Spell(before, after), tuple(_disturbances(edit, others, since_ns, after[0][1]))


def within(found: Spell, since_ns: int, until_ns: int) -> Spell:
    """Return the parts within one recording: outside of it the wearer is unknown."""
    sides = (
        [(max(since, since_ns), min(until, until_ns)) for since, until in spans]
        for spans in (found.before, found.after)
    )
    return Spell(*sides)


def _is_taken_over(edit: Edit, by: Edit) -> bool:
    """Return whether a trial's end is the other one's beginning: the same entry of the journal."""
    names = {change.name for change in by.changes}
    shares = any(change.name in names for change in edit.changes)
    return (
        edit.state is EditState.TAKEN_OVER and edit.ended_ns == by.in_force_ns and edit.id != by.id and shares
    )


def _instants(edit: Edit) -> Iterator[int]:
    """Yield when it changed what the robot does."""
    yield edit.began_ns if edit.in_force_ns is None else edit.in_force_ns
    if edit.ended_ns is not None:
        yield edit.ended_ns


def _disturbances(
    edit: Edit, others: Sequence[tuple[int, Edit]], since_ns: int, until_ns: int
) -> Iterator[str]:
    told = set()
    for at_ns, other in others:
        if since_ns - SETTLE_NS <= at_ns <= until_ns and other.id not in told:
            told.add(other.id)
            side = "before" if at_ns <= edit.began_ns else "after"
            yield f"the edit of {other.names} at {other.utc} ({other.id}) leaves fewer cycles {side} this one"
