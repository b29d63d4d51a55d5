"""The guard's rules, on while one joint is moved: any that trips, or cannot see what it watches, ends that.

No gateway runs beside a test, so the rules of the robot's file are judged here, by the guard's own watchers,
in the thread that brings what they see. Whatever a rule would do by itself, here it ends the motion.
"""

import threading
import time
from collections.abc import Iterator
from functools import partial
from typing import Self

from drivers.bus.bus import CanBus
from drivers.component import ComponentKind
from drivers.joint.drive import JointDrive
from gateway.config.guard_rules import GuardRule, SyncRule
from gateway.config.robot import RobotConfig
from gateway.guard.watcher import RuleState, RuleTransition, Watcher
from gateway.guard.wiring import Wiring
from gateway.modules.component.assembly import Robot

ALONE = "only the joint that is tested is followed"


class Guarding:
    """In a `with` block; `tripped` says which rule ends the test, and why."""

    def __init__(self, config: RobotConfig, reader: JointDrive, bus: CanBus) -> None:
        self.tripped: str | None = None
        self._lock = threading.Lock()
        others = {name: ComponentKind.JOINT for name in config.joint if name != reader.name}
        others |= dict.fromkeys(config.device, ComponentKind.DEVICE)
        absent = {name: (kind, ALONE) for name, kind in others.items()}
        robot = Robot(buses={bus.name: bus}, components={reader.name: reader}, absent=absent)
        now_ns = time.monotonic_ns()
        self._wirings = {
            name: Wiring(rule, robot, now_ns, partial(self._changed, name)) for name, rule in _rules(config)
        }
        self._names = {reader.name, bus.name}

    def __enter__(self) -> Self:
        for wiring in self._wirings.values():
            wiring.open()
        return self

    def __exit__(self, *_: object) -> None:
        for wiring in self._wirings.values():
            wiring.close()

    def look(self) -> None:
        """See what has not come; again and again."""
        now_ns = time.monotonic_ns()
        for watcher in self._watchers():
            watcher.look(now_ns)

    @property
    def rules(self) -> list[str]:
        """Those that watch this joint or its bus."""
        return [name for name, wiring in self._wirings.items() if any(map(self._ours, wiring.watchers))]

    def _watchers(self) -> Iterator[Watcher]:
        for wiring in self._wirings.values():
            yield from filter(self._ours, wiring.watchers)

    def _ours(self, watcher: Watcher) -> bool:
        return watcher.component in self._names

    def _changed(self, name: str, watcher: Watcher, change: RuleTransition) -> None:
        if change.state not in (RuleState.TRIPPED, RuleState.BLIND) or not self._ours(watcher):
            return
        with self._lock:
            self.tripped = self.tripped or f"guard rule {name}: {change.reason}"


def _rules(config: RobotConfig) -> Iterator[tuple[str, GuardRule]]:
    """SYNC is our own here, which nobody hears from himself."""
    for name, rule in (config.guard.rule if config.guard is not None else {}).items():
        if not isinstance(rule, SyncRule):
            yield name, rule
