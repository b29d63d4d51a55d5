"""A robot of parts that say what a test gives them, and what became of a rule's watchers."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import msgspec

from drivers.bus.bus import CanBus
from drivers.bus.liveness import NodeLife
from drivers.bus.settings import CanSettings
from drivers.component import Component, ComponentKind
from drivers.latest import Latest
from drivers.samples import Channel, ComponentState, Quality
from gateway.config.guard import WATCHES
from gateway.config.guard_rules import GuardRule
from gateway.guard.watcher import RuleState as Found
from gateway.guard.watcher import RuleTransition, Watcher
from gateway.guard.wiring import Wiring
from gateway.modules.component.assembly import Robot

S = 1_000_000_000
JOINT = (
    "position", "velocity", "torque", "current", "following_error", "digital_inputs", "voltage",
    "temperature",
)  # fmt: skip
IMU = ("tilt_forward", "tilt_side", "angular_velocity_x", "angular_velocity_y", "angular_velocity_z")


class Worker:
    """What a node is asked again and again, and what it says."""

    def __init__(self) -> None:
        self.repeated: list[tuple[float, Callable[[Any], None]]] = []
        self.answer: Exception | None = None

    def repeat(self, period_s: float, job: Callable[[Any], None]) -> Callable[[], None]:
        self.repeated.append((period_s, job))
        return lambda: self.repeated.remove((period_s, job))

    def ask(self) -> None:
        for _period_s, job in self.repeated:
            job(self)

    def upload(self, index: int, subindex: int, attempts: int) -> bytes:
        assert (index, subindex, attempts) == (0x1000, 0, 1)
        if self.answer is not None:
            raise self.answer
        return bytes(4)


@dataclass
class Part:
    """A component with channels, and the life of a node where it is one."""

    name: str
    kind: ComponentKind
    quantities: tuple[str, ...] = ()
    settings: Any = field(default_factory=lambda: SimpleNamespace(lost_after_s=2.0, stale_after_s=0.5))

    def __post_init__(self) -> None:
        self.channels = tuple(Channel(f"{self.name}.{q}", self.name, q, "u") for q in self.quantities)
        self.latest = Latest(self.name, self.channels, 0.5)
        self.worker = Worker()
        self.node = SimpleNamespace(
            life=NodeLife(None),
            description=SimpleNamespace(vendor_id=None),
            worker=self.worker,
            ready=True,
        )

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def quality(self, now_ns: int) -> Quality:
        return Quality(ComponentState.OK, 0.0)

    def give(self, quantity: str, value: float | None, stamp_ns: int | None = None) -> None:
        stamp_ns = time.monotonic_ns() if stamp_ns is None else stamp_ns
        self.latest.update(stamp_ns, (self.quantities.index(quantity),), (value,))


class Bench:
    """A robot of such parts, and what became of the watchers."""

    def __init__(self) -> None:
        self.knee, self.hip = (Part(name, ComponentKind.JOINT, JOINT) for name in ("left_knee", "left_hip"))
        self.gait, self.foot = (
            Part("gait", ComponentKind.DEVICE),
            Part("left_insole", ComponentKind.INSOLE, ("force",)),
        )
        self.other_foot = Part("right_insole", ComponentKind.INSOLE, ("force",))
        self.trunk = Part("trunk", ComponentKind.IMU, IMU)
        self.changes: list[RuleTransition] = []
        self.absent: dict[str, tuple[ComponentKind, str]] = {}
        self.held = False
        settings = CanSettings(interface="virtual", channel="guard wiring")
        self.buses = {name: CanBus(name, settings) for name in ("main", "other")}

    def wire(self, watch: str, **keys: Any) -> Wiring:
        parts: list[Component] = [self.knee, self.hip, self.gait, self.foot, self.other_foot, self.trunk]
        present = {part.name: part for part in parts if part.name not in self.absent}
        rule: GuardRule = msgspec.convert({"watch": watch, **keys}, WATCHES[watch].rule)
        robot = Robot(dict(self.buses), present, {}, self.absent)
        return Wiring(rule, robot, 0, self.changed, held=lambda: self.held)

    def changed(self, _watcher: Watcher, change: RuleTransition) -> None:
        self.changes.append(change)

    def states(self) -> list[Found]:
        return [one.state for one in self.changes]
