"""Makes of the rules and of the robot that is there the watchers, and brings them what they watch."""

import fnmatch
import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, cast

from drivers.component import Component, Kind
from drivers.samples import Sample
from gateway.guard.conditions import Band, Heat
from gateway.guard.inputs import (
    Changed,
    EmcyWatcher,
    LevelWatcher,
    Pulse,
    SilenceWatcher,
    UnseenWatcher,
)
from gateway.guard.settings import (
    WATCHES,
    EmcyRule,
    HeatRule,
    LevelRule,
    RangeRule,
    Rule,
    SilenceRule,
    quantities,
)
from gateway.guard.watcher import Watcher

if TYPE_CHECKING:
    from drivers.bus.device import CanDevice
    from drivers.bus.life import NodeLife
    from drivers.insole.device import Insole
    from drivers.joint.drive import JointDrive
    from gateway.modules.assembly import Robot

NOBODY = "the robot"


class Wiring:
    """The watchers of one rule. `changed` is called in the thread that brought what changed it."""

    def __init__(self, rule: Rule, robot: "Robot", now_ns: int, changed: Changed) -> None:
        self.rule = rule
        self._now_ns = now_ns
        self._changed = changed
        self._robot = robot
        self._begins: list[Callable[[], Callable[[], None]]] = []  # each returns how to end it
        self._ends: list[Callable[[], None]] = []
        self.watchers: tuple[Watcher, ...] = tuple(self._make())

    def open(self) -> None:
        """Begin to watch."""
        self._ends = [begin() for begin in self._begins]

    def close(self) -> None:
        """Watch no more."""
        for end in self._ends:
            end()

    def _make(self) -> Iterator[Watcher]:
        made = [watcher for name in self._names() for watcher in self._watchers(name)]
        yield from made or [self._unseen(NOBODY, f"has no {' or '.join(quantities(self.rule))}")]

    def _names(self) -> list[str]:
        """Components of the kinds that this rule can watch, there or not."""
        kinds = {name: one.kind for name, one in self._robot.components.items()}
        kinds |= {name: kind for name, (kind, _why) in self._robot.absent.items()}
        wanted = self.rule.on or ("*",)
        return [
            name
            for name, kind in kinds.items()
            if kind in WATCHES[self.rule.watch].kinds
            and any(fnmatch.fnmatchcase(name, glob) for glob in wanted)
        ]

    def _watchers(self, name: str) -> Iterator[Watcher]:
        component = self._robot.components.get(name)
        if component is None:
            yield self._unseen(name, f"is not there: {self._robot.absent[name][1]}")
        elif isinstance(self.rule, EmcyRule):
            yield self._emcy(self.rule, component)
        elif not quantities(self.rule):
            yield self._silence(component)
        else:
            yield from self._levels(component)

    def _unseen(self, name: str, why: str) -> Watcher:
        return UnseenWatcher(self.rule, name, self._now_ns, self._changed, why)

    def _silence(self, component: Component) -> Watcher:
        silent_s = self.rule.silent_s if isinstance(self.rule, SilenceRule) else None
        pulse = _pulse(component, silent_s)
        watcher = SilenceWatcher(self.rule, component.name, self._now_ns, self._changed, pulse)
        if component.kind is not Kind.INSOLE:
            self._begins.append(partial(_life(component).subscribe, watcher))
        return watcher

    def _emcy(self, rule: EmcyRule, component: Component) -> Watcher:
        on_node = cast("JointDrive | CanDevice", component)
        vendor, pulse = on_node.node.description.vendor_id, _pulse(component, on_node.settings.lost_after_s)
        watcher = EmcyWatcher(rule, component.name, self._now_ns, self._changed, pulse, vendor)
        self._begins.append(partial(_life(component).subscribe, watcher))
        return watcher

    def _levels(self, component: Component) -> Iterator[Watcher]:
        """One for each channel; a component without it is passed over where nobody has named it."""
        by_index: dict[int, LevelWatcher] = {}
        for quantity in quantities(self.rule):
            index = next((i for i, one in enumerate(component.channels) if one.quantity == quantity), None)
            if index is not None:
                by_index[index] = self._level(component, index)
            elif self.rule.on is not None:
                yield self._unseen(component.name, f"has no {quantity}")
        if by_index:
            self._begins.append(partial(component.latest.subscribe, partial(_hand_out, by_index)))
        yield from by_index.values()

    def _level(self, component: Component, index: int) -> LevelWatcher:
        rule, channel, stale_ns = self.rule, component.channels[index], component.latest.stale_after_ns
        unit = f" {channel.unit}"
        make = partial(LevelWatcher, rule, channel.name, now_ns=self._now_ns, changed=self._changed)
        if isinstance(rule, HeatRule):
            heat = Heat(rule.rated, rule.time_constant_s, stale_ns / 1e9)
            band = Band(-math.inf, rule.above, rule.hysteresis)
            return make(unit="", band=band, stale_ns=stale_ns, measure=heat.after)
        if isinstance(rule, LevelRule):
            band = Band(-rule.above, rule.above, rule.hysteresis)
            return make(unit=unit, band=band, stale_ns=stale_ns, for_s=rule.for_s)
        if isinstance(rule, RangeRule):
            low = -math.inf if rule.min is None else rule.min
            high = math.inf if rule.max is None else rule.max
            band = Band(low, high, rule.hysteresis)
            return make(unit=unit, band=band, stale_ns=stale_ns, for_s=rule.for_s)
        raise TypeError(f"{rule.watch} watches no channel")


def _hand_out(watchers: dict[int, LevelWatcher], sample: Sample) -> None:
    """A sample's values to who watches them; the hot path."""
    for index, value in zip(sample.indices, sample.values, strict=True):
        watcher = watchers.get(index)
        if watcher is not None:
            watcher.see(sample.stamp_ns, value)


def _life(component: Component) -> "NodeLife":
    return cast("JointDrive | CanDevice", component).node.life


def _pulse(component: Component, silent_s: float | None) -> Pulse:
    """A node's heartbeat; where it has none, all that it sends; an insole's samples."""
    latest = component.latest
    if component.kind is Kind.INSOLE:
        insole = cast("Insole", component)
        return Pulse(lambda: latest.updated_ns, lambda: silent_s or insole.settings.stale_after_s)
    life, settings = _life(component), cast("JointDrive | CanDevice", component).settings

    def last_ns() -> int | None:
        if life.timeout_s is not None:
            return life.heartbeat_ns
        signs = (life.heartbeat_ns, life.heard_ns, latest.updated_ns)
        return max((stamp_ns for stamp_ns in signs if stamp_ns is not None), default=None)

    return Pulse(last_ns, lambda: silent_s or life.timeout_s or settings.lost_after_s)
