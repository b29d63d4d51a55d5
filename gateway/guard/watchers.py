"""Makes the watchers of each kind of rule, and connects them to what brings them their values."""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial, singledispatch
from typing import TYPE_CHECKING, cast

from drivers.component import Component, ComponentKind
from drivers.errors import DeviceAbort, DeviceTimeout
from drivers.samples import Sample
from gateway.config.guard import quantities
from gateway.config.guard_rules import (
    BusRule,
    EmcyRule,
    GuardRule,
    LatencyRule,
    SilenceRule,
    StoppingRule,
    SymmetryRule,
    SyncRule,
)
from gateway.guard.buses import BusWatcher, SyncWatcher
from gateway.guard.inputs import (
    Changed,
    EmcyWatcher,
    Joining,
    LevelWatcher,
    Pulse,
    SilenceWatcher,
    UnseenWatcher,
)
from gateway.guard.thresholds import Beside, judging
from gateway.guard.watcher import Watcher

if TYPE_CHECKING:
    from drivers.bus.device import CanDevice
    from drivers.bus.node import Node
    from drivers.bus.sdo.channel import SdoChannel
    from drivers.insole.device import Insole
    from drivers.joint.drive import JointDrive
    from gateway.modules.component.assembly import Robot

See = Callable[[int, float | None], None]
Part = tuple[Component, str]  # a component and one of its quantities

DEVICE_TYPE = 0x1000
ASK_S = 1.0  # how often a node is asked, to see how long it takes to answer
UNASKED_NS = 5_000_000_000  # after so long without an answer, or the lack of one, nobody knows


@dataclass(frozen=True, slots=True)
class Wire:
    """Common arguments of a rule's watchers; `begins` are called on opening, each returns its end."""

    robot: "Robot"
    now_ns: int
    changed: Changed
    held: Callable[[], bool]
    begins: list[Callable[[], Callable[[], None]]] = field(default_factory=list)

    def unseen(self, rule: GuardRule, name: str, why: str) -> Watcher:
        """In the place of what cannot be watched."""
        return UnseenWatcher(rule, name, self.now_ns, self.changed, why)

    def absent(self, rule: GuardRule, name: str) -> Watcher:
        """In the place of a component that could not be built."""
        return self.unseen(rule, name, f"is not there: {self.robot.absent[name][1]}")

    def listen(self, component: Component, seeing: Mapping[int, See]) -> None:
        """Bring these channels of its samples, each to who sees it."""
        self.begins.append(partial(component.latest.subscribe, _HandOut(seeing)))


@singledispatch
def make(rule: GuardRule, wire: Wire, name: str) -> Iterator[Watcher]:
    """Yield the watchers of a component, or bus, that is there.

    One for each channel; what has none of them is passed over where nobody has named it.
    """
    component = wire.robot.components[name]
    seeing: dict[int, See] = {}
    for quantity in quantities(rule):
        index = _index(component, quantity)
        if index is not None:
            channel, stale_ns = component.channels[index].name, component.latest.stale_after_ns
            how = judging(rule, Beside(stale_ns / 1e9, wire.held))
            watcher = LevelWatcher(
                rule, name, channel, wire.now_ns, wire.changed, judging=how, stale_ns=stale_ns
            )
            seeing[index] = watcher.see
            yield watcher
        elif rule.on is not None:
            yield wire.unseen(rule, name, f"has no {quantity}")
    if seeing:
        wire.listen(component, seeing)


@make.register
def _silence(rule: SilenceRule, wire: Wire, name: str) -> Iterator[Watcher]:
    component = wire.robot.components[name]
    watcher = SilenceWatcher(rule, name, wire.now_ns, wire.changed, _pulse(component, rule.silent_s))
    if component.kind is not ComponentKind.INSOLE:
        wire.begins.append(partial(_on_node(component).node.life.subscribe, watcher))
    yield watcher


@make.register
def _emcy(rule: EmcyRule, wire: Wire, name: str) -> Iterator[Watcher]:
    one = _on_node(wire.robot.components[name])
    vendor, pulse = one.node.description.vendor_id, _pulse(one, one.settings.lost_after_s)
    watcher = EmcyWatcher(rule, name, wire.now_ns, wire.changed, pulse, vendor)
    wire.begins.append(partial(one.node.life.subscribe, watcher))
    yield watcher


@make.register
def _latency(rule: LatencyRule, wire: Wire, name: str) -> Iterator[Watcher]:
    how = judging(rule, Beside(UNASKED_NS / 1e9))
    watcher = LevelWatcher(rule, name, name, wire.now_ns, wire.changed, judging=how, stale_ns=UNASKED_NS)
    node = _on_node(wire.robot.components[name]).node
    wire.begins.append(partial(node.worker.repeat, ASK_S, partial(_ask, node, watcher)))
    yield watcher


@make.register
def _stopping(rule: StoppingRule, wire: Wire, name: str) -> Iterator[Watcher]:
    component = wire.robot.components[name]
    parts = [(component, quantity) for quantity in quantities(rule)]
    missing = [quantity for _, quantity in parts if _index(component, quantity) is None]
    if not missing:
        yield _joined(rule, wire, parts)
    elif rule.on is not None:
        yield wire.unseen(rule, name, f"has no {' and no '.join(missing)}")


@make.register
def _symmetry(rule: SymmetryRule, wire: Wire, name: str) -> Iterator[Watcher]:
    if rule.right not in wire.robot.components:
        yield wire.absent(rule, rule.right)
        return
    parts = [(wire.robot.components[side], rule.quantity) for side in (name, rule.right)]
    missing = [one.name for one, quantity in parts if _index(one, quantity) is None]
    if missing:
        yield wire.unseen(rule, missing[0], f"has no {rule.quantity}")
    else:
        yield _joined(rule, wire, parts, round(rule.window_s * 1e9))


@make.register
def _bus(rule: BusRule, wire: Wire, name: str) -> Iterator[Watcher]:
    bus = wire.robot.buses[name]
    watcher = BusWatcher(rule, bus, wire.now_ns, wire.changed)

    def begin() -> Callable[[], None]:
        bus.hold(watcher)
        return partial(bus.release, watcher)

    wire.begins.append(begin)
    yield watcher


@make.register
def _sync(rule: SyncRule, wire: Wire, name: str) -> Iterator[Watcher]:
    bus = wire.robot.buses[name]
    watcher = SyncWatcher(rule, name, wire.now_ns, wire.changed)

    def begin() -> Callable[[], None]:
        bus.subscribe(rule.can_id, watcher.on_frame)
        return partial(bus.unsubscribe, rule.can_id, watcher.on_frame)

    wire.begins.append(begin)
    yield watcher


def _joined(rule: GuardRule, wire: Wire, parts: Sequence[Part], coming_ns: int = 0) -> Watcher:
    """One watcher of several channels, in this order."""
    names = dict.fromkeys(component.name for component, _ in parts)
    stale_ns = min(component.latest.stale_after_ns for component, _ in parts)
    how = judging(rule, Beside(stale_ns / 1e9, wire.held))
    if how.joined is None:
        raise TypeError(f"{rule.watch} judges each channel by itself")
    watcher = LevelWatcher(
        rule,
        ", ".join(names),
        " and ".join(names),
        wire.now_ns,
        wire.changed,
        judging=how,
        stale_ns=stale_ns,
        coming_ns=coming_ns,
    )
    joining = Joining(watcher, how.joined, len(parts), stale_ns)
    for part, (component, quantity) in enumerate(parts):
        index = _index(component, quantity)
        if index is not None:
            wire.listen(component, {index: partial(joining.see, part)})
    return watcher


def _ask(node: "Node", watcher: LevelWatcher, sdo: "SdoChannel") -> None:
    """Measure the time of an answer, refusals included. In a node's worker, after its boot-up."""
    if not node.ready:
        return
    asked_ns = time.monotonic_ns()
    try:
        sdo.upload(DEVICE_TYPE, 0, attempts=1)
    except DeviceTimeout:
        watcher.weigh(time.monotonic_ns(), math.inf)
        return
    except DeviceAbort:
        pass
    answered_ns = time.monotonic_ns()
    watcher.weigh(answered_ns, (answered_ns - asked_ns) / 1e9)


class _HandOut:
    """A sample's values to who watches them; the hot path: most samples bring a rule nothing."""

    def __init__(self, seeing: Mapping[int, See]) -> None:
        self._seeing = dict(seeing)
        self._plans: dict[tuple[int, ...], tuple[tuple[int, See], ...]] = {}  # by a sample's indices

    def __call__(self, sample: Sample) -> None:
        plan = self._plans.get(sample.indices)
        if plan is None:
            places = enumerate(sample.indices)
            plan = tuple((place, self._seeing[index]) for place, index in places if index in self._seeing)
            self._plans[sample.indices] = plan
        for place, see in plan:
            see(sample.stamp_ns, sample.values[place])


def _index(component: Component, quantity: str) -> int | None:
    return next((i for i, one in enumerate(component.channels) if one.quantity == quantity), None)


def _on_node(component: Component) -> "JointDrive | CanDevice":
    return cast("JointDrive | CanDevice", component)


def _pulse(component: Component, silent_s: float | None) -> Pulse:
    """Return a node's heartbeat; where it has none, all that it sends; an insole's samples."""
    latest = component.latest
    if component.kind is ComponentKind.INSOLE:
        insole = cast("Insole", component)
        return Pulse(lambda: latest.updated_ns, lambda: silent_s or insole.settings.stale_after_s)
    life, settings = _on_node(component).node.life, _on_node(component).settings

    def last_ns() -> int | None:
        if life.timeout_s is not None:
            return life.heartbeat_ns
        signs = (life.heartbeat_ns, life.heard_ns, latest.updated_ns)
        return max((stamp_ns for stamp_ns in signs if stamp_ns is not None), default=None)

    return Pulse(last_ns, lambda: silent_s or life.timeout_s or settings.lost_after_s)
