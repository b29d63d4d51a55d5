"""Changes of the walk between two sessions, by the metrics of edits.

The gait cycles of both are compared as those before and after an edit: equal activity, equal speed, without a
slow drift. Two sessions differ in more than anybody has noted, so a metric *moved with* what changed; that
it moved by it, only trials on one day can show.
"""

import bisect
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Any, Final

import numpy as np
import pyarrow as pa
from msgspec import Struct
from msgspec.structs import replace as with_fields

from ml.store.sessions import Session
from ml.store.tables import PREDICTIONS, RESOURCES
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.evidence.comparison import Evidence, Spell, compare, differing
from server_gui.core.evidence.cycles import Cycle, CycleCutter
from server_gui.core.evidence.measures import CURVES
from server_gui.core.processing.wiring import Wiring

LONGEST_S: Final = 1800.0  # of each session, from its beginning
ROWS: Final = 256  # at a time: what computer and models say is told between
APART_NS: Final = 10_000_000_000  # between the two walks, as they are laid one after the other
ACTIVITY: Final = "activity"
DAYS: Final = (
    "two walks of one set-up differ, too, by the day and by how the robot was put on: how much was not "
    "measured here, so a difference may be that alone"
)

Advance = Callable[[int], object]


class Walk(Struct, frozen=True):
    """The gait cycles of a session, its joints, and what was not recorded of it."""

    cycles: Sequence[Cycle]
    joints: tuple[str, ...]
    knows_activity: bool
    notes: tuple[str, ...] = ()


def walk(
    known: Recordings, session: Session, advance: Advance = lambda _: None, longest_s: float = LONGEST_S
) -> Walk:
    """Cut a session's telemetry into gait cycles; raises `StoreError`, `SpoolUnusable`."""
    recorded = known.open(known.find(session.session, session.robot))
    names = [channel.name for channel in recorded.channels]
    joints = tuple(name.rpartition(".")[0] for name in names if name.endswith(".position"))
    enabled = recorded.enabled
    wanted = Wiring.of(names).channels
    wanted |= {f"{joint}.{curve}" for joint in joints for curve in CURVES} & {*names}
    wanted |= enabled.keys() & {*names}
    said = sorted(
        (int(row["stamp_ns"]), str(row["label"]))
        for row in known.rows_of(session, PREDICTIONS)
        if row["task"] == ACTIVITY and row["stamp_ns"] is not None
    )
    cutter = CycleCutter()
    cutter.enabled = enabled
    used = _Between(cutter, said, known.rows_of(session, RESOURCES))
    cycles: list[Cycle] = []
    first = recorded.session.first
    until = None if first is None else first + timedelta(seconds=longest_s)
    for table in recorded.telemetry(sorted(wanted), None, until) if wanted and first else ():
        for stamps_ns, columns in _parts(table):
            used.until(stamps_ns[-1])
            cycles += cutter.take(stamps_ns, columns)
        advance(table.num_rows)
    notes = [] if enabled or not joints else ["whether its drives were enabled was not recorded"]
    length_s = recorded.session.length.total_seconds()
    if length_s > longest_s:
        notes.append(f"the first {longest_s / 60:.0f} of its {length_s / 60:.0f} minutes")
    return Walk(cycles, joints, bool(said), tuple(notes))


def moved(before: Walk, after: Walk) -> Evidence:
    """Return the differences between two walks, in the words of edits."""
    sides = [before.cycles, after.cycles]
    notes = [f"before: {one}" for one in before.notes] + [f"after: {one}" for one in after.notes]
    if before.knows_activity != after.knows_activity:
        sides = [[replace(cycle, activity="") for cycle in side] for side in sides]
        notes.append("only one of them tells what the wearer did: all walking is compared")
    ends = [max((cycle.ended_ns for cycle in side), default=0) for side in sides]
    begins = [min((cycle.began_ns for cycle in side), default=0) for side in sides]
    shift_ns = ends[0] - begins[1] + APART_NS  # each robot's clock begins with its boot
    later = [
        replace(cycle, began_ns=cycle.began_ns + shift_ns, ended_ns=cycle.ended_ns + shift_ns)
        for cycle in sides[1]
    ]
    spell = Spell([(begins[0], ends[0])], [(begins[1] + shift_ns, ends[1] + shift_ns)])
    joints = list(dict.fromkeys([*before.joints, *after.joints]))
    found = compare(itertools.chain(sides[0], later), spell, joints)
    if any(differing(found.metrics)):
        notes.append(DAYS)
    return with_fields(found, notes=(*found.notes, *notes))


class _Between:
    """Tells the cutter what models and computer said, up to the rows that come next."""

    def __init__(
        self, cutter: CycleCutter, said: Sequence[tuple[int, str]], looks: Sequence[dict[str, Any]]
    ) -> None:
        self._cutter = cutter
        self._said = said
        self._looks = sorted(
            (int(row["stamp_ns"]), row["cpu_percent"]) for row in looks if row["stamp_ns"] is not None
        )
        self._told = 0

    def until(self, stamp_ns: int) -> None:
        later = bisect.bisect_right(self._said, (stamp_ns, chr(0x10FFFF)))
        for at_ns, word in self._said[self._told : later]:
            self._cutter.label(at_ns, word)
        self._told = max(self._told, later)
        looks = bisect.bisect_right([at_ns for at_ns, _ in self._looks], stamp_ns)
        if looks:
            self._cutter.tell("cpu", self._looks[looks - 1][1])
            self._looks = self._looks[looks:]


def _parts(table: pa.Table) -> Iterator[tuple[list[int], dict[str, list[float | None]]]]:
    """Yield a few rows at a time, in which no channel is missing altogether."""
    for begin in range(0, table.num_rows, ROWS):
        part = table.slice(begin, ROWS)
        columns = {name: part[name] for name in part.column_names if name not in ("utc", "stamp_ns")}
        known = {
            name: column.to_pylist() for name, column in columns.items() if column.null_count < len(column)
        }
        stamps = part["stamp_ns"].to_numpy()
        yield np.asarray(stamps, dtype=np.int64).tolist(), known
