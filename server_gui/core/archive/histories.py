"""Each robot's journal from everywhere: what it tells itself, and what was collected of it before."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from gateway.wire.robot import Description
from server_gui.core.archive.collected_journals import CollectedJournal, JournalsFound
from server_gui.core.audit import chains
from server_gui.core.audit.acts import Act, acts
from server_gui.core.audit.chains import Entry
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station

ROBOT, STORE = "robot", "store"  # who tells


@dataclass(frozen=True)
class History:
    """Snapshot of a robot's past; equal ones have equal contents. `kept` is the collected journal."""

    station: Station | None
    kept: CollectedJournal | None
    revision: int = 0  # of what the robot tells
    description: Description | None = None

    @cached_property
    def verdict(self) -> str:
        """In words, how far it can be believed."""
        told = [] if self.station is None else [self.station.audit.verdict.rstrip(".")]
        told += [] if self.kept is None else [self.kept.verdict]
        told += [f"robot and store differ, {self._differs}"] if self._differs else []
        return f"{'; '.join(told)}."

    @cached_property
    def is_altered(self) -> bool:
        """Whether anything speaks against it."""
        told = self.station is not None and self.station.audit.problem is not None
        return told or (self.kept is not None and self.kept.problem is not None) or self._differs is not None

    @property
    def is_known(self) -> bool:
        """Whether anything of it has been read."""
        return bool(self._stretches)

    @cached_property
    def acts(self) -> Sequence[tuple[Act, str]]:
        """Acts, oldest first, with their sources."""
        by_robot = {entry["hash"] for entry in self._live}
        found = itertools.chain.from_iterable(map(acts, chains.journals(self._stretches)))
        return [(act, ROBOT if act.hash in by_robot else STORE) for act in found]

    @cached_property
    def _live(self) -> list[Entry]:
        return [] if self.station is None else list(self.station.audit.entries)

    @cached_property
    def _stretches(self) -> list[list[Entry]]:
        kept = () if self.kept is None else self.kept.stretches
        return chains.chained([*itertools.chain(*kept), *self._live])

    @cached_property
    def _differs(self) -> str | None:
        return chains.fork(self._stretches) if self.kept is not None and self.kept.problem is None else None


def histories(desk: Desk, found: JournalsFound) -> dict[str, History]:
    """Return them by title: the desk's robots, then those that are away, but were collected."""
    away = dict(found.by_robot)
    called = {
        station.title: History(
            station, away.pop(station.name, None), station.audit.revision, station.robot.description
        )
        for station in desk
    }
    for name, kept in away.items():
        called[f"{name}, by the store" if name in called else name] = History(None, kept)
    return called
