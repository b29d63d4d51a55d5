"""The watchers of one rule on the robot that is there: one for each of what it watches, or why not."""

import fnmatch
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

from gateway.config.guard import BUS, WATCHES, quantities
from gateway.config.guard_rules import GuardRule, SymmetryRule
from gateway.guard.inputs import Changed
from gateway.guard.watcher import Watcher
from gateway.guard.watchers import Wire, make

if TYPE_CHECKING:
    from gateway.modules.component.assembly import Robot

NOBODY = "the robot"


class Wiring:
    """The watchers of one rule. `changed` is called in the thread that brought what changed it.

    `held` says whether a stop is held; any thread may ask it.
    """

    def __init__(
        self,
        rule: GuardRule,
        robot: "Robot",
        now_ns: int,
        changed: Changed,
        held: Callable[[], bool] = lambda: False,
    ) -> None:
        self.rule = rule
        self._robot = robot
        self._wire = Wire(robot, now_ns, changed, held)
        self._ends: list[Callable[[], None]] = []
        self.watchers: tuple[Watcher, ...] = tuple(self._make())

    def open(self) -> None:
        """Begin to watch."""
        self._ends = [begin() for begin in self._wire.begins]

    def close(self) -> None:
        """Watch no more."""
        for end in self._ends:
            end()

    def _make(self) -> Iterator[Watcher]:
        made = [watcher for name in self._names() for watcher in self._watchers(name)]
        missing = " or ".join(quantities(self.rule))
        yield from made or [self._wire.unseen(self.rule, NOBODY, f"has no {missing}")]

    def _names(self) -> list[str]:
        """Return the names of this rule's inputs, there or not."""
        kinds, wanted = WATCHES[self.rule.watch].kinds, self.rule.on or ("*",)
        if isinstance(self.rule, SymmetryRule):
            wanted = (self.rule.left,)
        return [
            name
            for name, kind in self._known().items()
            if kind in kinds and any(fnmatch.fnmatchcase(name, glob) for glob in wanted)
        ]

    def _known(self) -> Mapping[str, str]:
        """Return every component, or every bus, and its kind."""
        if BUS in WATCHES[self.rule.watch].kinds:
            return dict.fromkeys(self._robot.buses, BUS)
        absent = {name: kind for name, (kind, _why) in self._robot.absent.items()}
        return {name: one.kind for name, one in self._robot.components.items()} | absent

    def _watchers(self, name: str) -> Iterator[Watcher]:
        if name in self._robot.absent and BUS not in WATCHES[self.rule.watch].kinds:
            yield self._wire.absent(self.rule, name)
        else:
            yield from make(self.rule, self._wire, name)
