"""One robot's edits and gait cycles, followed live: what each edit has done so far, and in the end."""

import collections
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from msgspec.structs import replace

from gateway.wire.bus import BusInfo
from gateway.wire.robot import Description
from server_gui.core.evidence.comparison import Spell, compare
from server_gui.core.evidence.curves import curves, told_joints
from server_gui.core.evidence.cycles import ENABLED, Cycle, CycleCutter
from server_gui.core.evidence.edits import (
    AFTER_NS,
    BACK_NS,
    BEFORE_NS,
    TRIAL_NS,
    Edit,
    EditState,
    JournalEdits,
    due_ns,
    spell,
    within,
)
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.follow.events import (
    BusesSeen,
    Described,
    Event,
    Journalled,
    Looked,
    Resources,
    Telemetry,
)
from server_gui.core.processing.wiring import STATE
from server_gui.core.recording.journal_tail import news
from server_gui.core.recording.rows import JournalHead

LATE_NS: Final = 10_000_000_000  # after which the journal has told everything of an instant
LONGEST_NS: Final = max(AFTER_NS, TRIAL_NS + BACK_NS)  # from an edit until nothing more comes of it
NEVER_NS: Final = 2**63
OUTSIDE: Final = "a recording began or ended within its time: what is outside, of anybody, does not count"
KEPT_NS: Final = BEFORE_NS + LONGEST_NS + 2 * LATE_NS  # of cycles
MISSED: Final = (
    "entries of the robot's journal were missed: what is of that time, of whatever edit, does not count"
)
JOINT: Final = "joint"  # the kind of component


@dataclass(frozen=True, slots=True)
class Recorded:
    """From now on, events are in the recording of this name; empty: in none."""

    session: str


class RobotEvidence:
    """Takes what one robot's feed tells, in order; `look` gives what is new about its edits.

    Only edits that were begun while it was followed: of those before nothing was seen.
    """

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self.cycles: collections.deque[Cycle] = collections.deque()
        self._cutter = CycleCutter()
        self._edits = JournalEdits(robot)
        self._description: Description | None = None
        self._boot_id: str | None = None
        self.joints: tuple[str, ...] = ()  # in the robot's order
        self._head: JournalHead | None = None
        self._recordings: list[tuple[int, str]] = [
            (-NEVER_NS, "")
        ]  # since when (robot's clock), and their names; one has pieces where the journal was missed
        self._told_ns = 0  # until when the journal has told everything
        self._first_ns: int | None = None  # the first row of this boot
        self.newest_ns = 0  # the newest row, on the robot's clock
        self._seen: dict[str, tuple[Edit, Spell, int | None]] = {}  # how, and at how many cycles at most
        self.cut = 0  # cycles, also those that were forgotten
        self._over: set[str] = set()

    def take(self, event: Event | Recorded) -> list[EditEvidence]:
        """Take one fact; what can become no more where it ends something."""
        match event:
            case Recorded():
                self._recorded(event.session)
            case Telemetry(batch=batch):
                self._rows(list(batch.stamps_ns), batch.columns)
            case Journalled():
                self._journal(event.journal.entries)
            case Looked():
                states = event.quality.quality.items()
                self._cutter.distrust(frozenset(name for name, one in states if one.get("state") == "fault"))
            case Resources():
                self._cutter.tell("cpu", event.snapshot.cpu.percent)
            case BusesSeen():
                self._cutter.tell("bus_load", _load(event.buses))
            case Described():
                return self._described(event.description)
        return []

    def session_of(self, edit: Edit) -> str:
        """Return the name of the recording in which the edit was made."""
        return self._recordings[self._place(edit)][1]

    def label(self, stamp_ns: int, activity: str) -> None:
        """Take a model's activity of the wearer at an instant."""
        self._cutter.label(stamp_ns, activity)

    def look(self) -> list[EditEvidence]:
        """Return the edits of which something new is known since the last look."""
        return [told for edit in self._open() if (told := self._look(edit)) is not None]

    def end(self) -> list[EditEvidence]:
        """Return the final evidence of the edits that were still followed."""
        told = [self._told(_left(edit), is_final=True) for edit in self._open()]
        self._over |= {one.edit.id for one in told}
        return told

    def anew(self) -> "RobotEvidence":
        """Return one that has seen nothing, but knows what the robot has said of itself once."""
        other = RobotEvidence(self.robot)
        if self._description is not None:
            other.take(Described(self._description))
        other.take(Recorded(self._recordings[-1][1]))
        return other

    # --- inside

    def _told(self, edit: Edit, *, is_final: bool) -> EditEvidence:
        """Return the effect of an edit, from the cycles until now."""
        windows, notes = self._spell(edit)
        edited = [joint for joint in self.joints if joint in edit.components]
        found = compare(self.cycles, windows, self.joints, edited)
        drawn = curves(self.cycles, windows, told_joints(found, edited))
        return EditEvidence(edit, replace(found, notes=found.notes + notes), is_final, curves=drawn)

    def _recorded(self, session: str) -> None:
        """Begin another recording: its data is not compared with edits of the one before."""
        if session == self._recordings[-1][1]:
            return
        if self._first_ns is None:  # nothing was seen before it
            self._recordings = [(-NEVER_NS, session)]
            return
        self._divide(self.newest_ns, session)

    def _divide(self, at_ns: int, session: str) -> None:
        """Mark a break: later data is not compared with earlier."""
        self._recordings.append((at_ns, session))
        while len(self._recordings) > 1 and self._recordings[1][0] < self.newest_ns - KEPT_NS:
            del self._recordings[0]

    def _place(self, edit: Edit) -> int:
        """Return the index of the recording in which the edit was made."""
        later = (place for place, (since, _) in enumerate(self._recordings) if since > edit.began_ns)
        return max(next(later, len(self._recordings)) - 1, 0)

    def _spell(self, edit: Edit) -> tuple[Spell, tuple[str, ...]]:
        """Return when its old and new values were in force, within the recording of the edit."""
        windows, notes = spell(edit, self._edits.all)
        place = self._place(edit)
        since_ns = self._recordings[place][0]
        until_ns = self._recordings[place + 1][0] if place + 1 < len(self._recordings) else NEVER_NS
        inside = within(windows, since_ns, until_ns)
        if inside == windows:
            return inside, notes
        around = self._recordings[max(place - 1, 0) : place] + self._recordings[place + 1 : place + 2]
        missed = any(session == self._recordings[place][1] for _, session in around)
        return inside, (*notes, MISSED if missed else OUTSIDE)

    def _rows(self, stamps_ns: list[int], columns: Mapping[str, Any]) -> None:
        if not stamps_ns:
            return
        if self._first_ns is None:
            self._first_ns = stamps_ns[0]
        self.newest_ns = stamps_ns[-1]
        found = self._cutter.take(stamps_ns, columns)
        self.cut += len(found)
        self.cycles.extend(found)
        while self.cycles and self.cycles[0].ended_ns < self.newest_ns - KEPT_NS:
            self.cycles.popleft()

    def _journal(self, entries: list[dict[str, Any]]) -> None:
        found = news(entries, self._head)
        if found.missing:
            self._missed(found.entries[0])
        self._told_ns = self.newest_ns
        if found.entries:
            newest = found.entries[-1]
            self._head = JournalHead(newest["n"], newest["hash"])
            self._edits.take(entry for entry in found.entries if entry.get("boot_id") == self._boot_id)
            self._edits.forget(self.newest_ns - KEPT_NS)

    def _missed(self, first: Mapping[str, Any]) -> None:
        """Whatever was written before this entry, and how trials have ended, nobody here will ever know."""
        if first.get("boot_id") != self._boot_id:
            return  # it was in a boot that nothing is of
        stamp_ns, session = first.get("monotonic_ns"), self._recordings[-1][1]
        until_ns = stamp_ns if isinstance(stamp_ns, int) else self.newest_ns
        self._edits.lose_sight(self._told_ns)
        self._divide(self._told_ns, session)
        self._divide(max(until_ns, self._told_ns), session)

    def _described(self, description: Description) -> list[EditEvidence]:
        ended: list[EditEvidence] = []
        self._description = description
        if self._boot_id not in (None, description.boot_id):
            ended = self.end()
            self.cycles.clear()
            self._cutter.restart()
            self._edits = JournalEdits(self.robot)
            self._first_ns, self.newest_ns, self._told_ns = None, 0, 0
            self._recordings = [(-NEVER_NS, self._recordings[-1][1])]
        if self._boot_id != description.boot_id:
            self._head = None
        self._boot_id = description.boot_id
        self.joints = tuple(part.name for part in description.components if part.kind == JOINT)
        self._cutter.enabled = {
            channel.name: frozenset(float(number) for number, word in channel.enum.items() if word == ENABLED)
            for channel in description.channels
            if channel.enum and channel.quantity == STATE
        }
        return ended

    def _ours(self) -> list[Edit]:
        return [
            edit
            for edit in self._edits.all
            if edit.state is not EditState.ASKED or edit.in_force_ns is not None
        ]

    def _open(self) -> Iterator[Edit]:
        first_ns = self._first_ns
        for edit in self._ours():
            followed = first_ns is not None and edit.began_ns >= first_ns
            if followed and edit.state is not EditState.FAILED and edit.id not in self._over:
                yield edit

    def _look(self, edit: Edit) -> EditEvidence | None:
        until_ns = due_ns(edit)
        is_final = until_ns is not None and self.newest_ns > until_ns + LATE_NS
        windows, _ = self._spell(edit)
        last_ns = max(until for _, until in (*windows.before, *windows.after))
        grows = self.newest_ns <= last_ns + LATE_NS
        looked = (edit, windows, self.cut if grows else None)
        if self._seen.get(edit.id) == looked and not is_final:
            return None
        self._seen[edit.id] = looked
        if is_final:
            self._over.add(edit.id)
            del self._seen[edit.id]
        return self._told(edit, is_final=is_final)


def _left(edit: Edit) -> Edit:
    """Return an edit that nobody follows any more: of a trial nobody here hears how it ends."""
    return replace(edit, state=EditState.ASKED) if edit.state is EditState.ON_TRIAL else edit


def _load(buses: tuple[BusInfo, ...] | None) -> float | None:
    """Return the busiest bus's."""
    return max((bus.load_percent for bus in buses or () if bus.load_percent is not None), default=None)
