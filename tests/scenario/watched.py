"""A simulated robot, the gateway's drivers and rules of its guard, in simulated time and without a thread.

Frames go over the simulated bus, bytes over the simulated lines, to the product's own drivers and watchers.
Only what waits is replaced: the thread of the bus, those of the ports, and SDO's.
"""

import itertools
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from drivers.bus.bus import BusUser, CanBus
from drivers.bus.frames import ERROR
from drivers.bus.sdo.channel import SdoChannel
from drivers.errors import DeviceAbort, DeviceTimeout, DriverError
from gateway.config import RobotConfig, load
from gateway.config.guard_rules import GuardRule
from gateway.guard.watcher import RuleState, RuleTransition, Watcher
from gateway.guard.wiring import Wiring
from gateway.modules.component.assembly import Robot, assemble
from gateway.process.futures import done, failed
from hil_sim import robot_file
from hil_sim.bus.can_bus import Frame
from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.faults.injector import Faults
from hil_sim.sensors.tables import companions
from tests.unit.bus.direct import Direct

EPOCH_NS = 1000 * SECOND_NS  # of the monotonic clock when the robot is switched on
LOOK_NS = 50 * MILLISECOND_NS  # how often the guard's loop looks, and the bus's thread ticks


class Time(SimpleNamespace):
    """Stands in for the module `time`."""

    def __init__(self, clock: Clock) -> None:
        def now_ns() -> int:
            return EPOCH_NS + clock.now_ns

        super().__init__(monotonic_ns=now_ns, time_ns=now_ns, monotonic=lambda: now_ns() / 1e9)


class DirectBus(CanBus):
    """The gateway's end of the simulated bus: frames come as the simulated clock says."""

    def join(self, robot: Exoskeleton, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._simulated = robot.bus
        robot.bus.attach(self, self._carried, self._error)
        robot.clock.every(LOOK_NS, self._look)

    def hold(self, user: BusUser) -> None:
        if user not in self._users:
            self._users = (*self._users, user)
            user.bus_opened()

    def release(self, user: BusUser) -> None:
        self._users = tuple(known for known in self._users if known is not user)

    def send(self, can_id: int, data: bytes) -> None:
        self._simulated.send(Frame(can_id, data), self)

    def _carried(self, frame: Frame, _sender: object) -> None:
        self.frames += 1
        handler = self._handlers.get(frame.cob_id)
        if handler is not None:
            handler(self._now_ns(), frame.data)

    def _error(self, error_class: int) -> None:
        self.health.take_error(self._now_ns(), ERROR | error_class, b"")

    def _look(self) -> None:
        self._tick(self._now_ns())


class DirectSdo(SdoChannel):
    """Asks a simulated node over the simulated bus, and lets simulated time pass until it answers."""

    def __init__(self, node_id: int, robot: Exoskeleton) -> None:
        super().__init__(f"node {node_id}", Direct(lambda _data: None), 0.5)
        self._asks, answers = 0x600 + node_id, 0x580 + node_id
        self._bus, self._clock = robot.bus, robot.clock
        self._answer: bytes | None = None
        robot.bus.attach(self, self._receive)
        robot.bus.accept(self, {answers})

    def upload(self, index: int, subindex: int, attempts: int = 1, timeout_s: float | None = None) -> bytes:
        what = index.to_bytes(2, "little") + bytes([subindex])
        end_ns = self._clock.now_ns + round((timeout_s or self.timeout_s) * SECOND_NS)
        self._answer = None
        self._bus.send(Frame(self._asks, b"\x40" + what + bytes(4)), self)
        while self._answer is None or self._answer[1:4] != what:
            due_ns = self._clock.next_due_ns()
            if due_ns is None or due_ns > end_ns:
                raise DeviceTimeout(f"{self.label}: no answer")
            self._clock.run_until(due_ns)
        if self._answer[0] == 0x80:
            raise DeviceAbort(f"{self.label}: refused", int.from_bytes(self._answer[4:], "little"))
        return self._answer[4 : 8 - (self._answer[0] >> 2 & 3)]

    def _receive(self, frame: Frame, _sender: object) -> None:
        self._answer = frame.data


class DirectWorker:
    """Does every job at once, and what is repeated when the simulated clock says so, one after another."""

    def __init__(self, sdo: DirectSdo, clock: Clock) -> None:
        self._sdo = self.channel = sdo
        self._clock = clock
        self._waiting: list[Callable[[SdoChannel], object]] = []

    def start(self) -> None:
        """Nothing waits."""

    def submit(self, job: Callable[[SdoChannel], Any], **_how: Any) -> "Future[Any]":
        try:
            return done(job(self._sdo))
        except DriverError as error:
            return failed(error)

    def repeat(self, period_s: float, job: Callable[[SdoChannel], object]) -> Callable[[], None]:
        return self._clock.every(round(period_s * SECOND_NS), partial(self._repeat, job)).cancel

    def _repeat(self, job: Callable[[SdoChannel], object]) -> None:
        if job not in self._waiting:
            self._waiting.append(job)
            if len(self._waiting) == 1:
                self._next()

    def _next(self) -> None:
        self.submit(self._waiting[0])
        self._waiting.pop(0)
        if self._waiting:
            self._clock.after(0, self._next)


class DirectPort:
    """The gateway's end of a serial line, and the simulator's."""

    problem: str | None = None
    opened_ns: int | None = None

    def __init__(
        self,
        path: str,
        baudrate: int,
        received: Callable[[bytes, int], None],
        opened: Callable[[], None],
        closed: Callable[[], None],
        *,
        ports: "dict[str, DirectPort]",
        now_ns: Callable[[], int],
    ) -> None:
        self.baudrate = baudrate
        self._received, self._opened, self._closed, self._now_ns = received, opened, closed, now_ns
        ports[Path(path).name] = self

    def start(self) -> None:
        self.plug(True)

    def plug(self, plugged: bool) -> None:
        if plugged is not (self.opened_ns is not None):
            self.opened_ns = self._now_ns() if plugged else None
            (self._opened if plugged else self._closed)()

    def write(self, data: bytes) -> None:
        self._received(data, self._now_ns())


class Watched:
    """A robot that walks, and rules by their names; `changes` is what became of each, with the time (s)."""

    def __init__(
        self,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
        rules: str,
        prepare: Callable[[Exoskeleton], object] = lambda _robot: None,
    ) -> None:
        """`rules` are tables of the robot's file; `prepare` sets up the robot before its gateway comes."""
        self.simulated = Exoskeleton(Scenario.WALK)
        self.clock = self.simulated.clock
        self.faults = Faults(self.simulated, folder)
        self.changes: list[tuple[float, str, RuleTransition]] = []
        self.held = False
        self._wirings: dict[str, Wiring] = {}
        self._replace(monkeypatch)
        config = self._config(folder, rules)
        self.robot = self._assemble(config)
        self.simulated.power_on()
        self.run(0.7)
        prepare(self.simulated)
        for component in self.robot.components.values():
            component.start()
        self._watch({} if config.guard is None else config.guard.rule)
        self.run(0.6)

    def _watch(self, rules: Mapping[str, GuardRule]) -> None:
        for name, rule in rules.items():
            changed = partial(self._changed, name)
            wiring = Wiring(rule, self.robot, self.now_ns(), changed, held=lambda: self.held)
            wiring.open()
            self._wirings[name] = wiring
        self.clock.every(LOOK_NS, self._look)

    def now_ns(self) -> int:
        return EPOCH_NS + self.clock.now_ns

    def run(self, seconds: float) -> None:
        """Let so much simulated time pass."""
        self.clock.run_until(self.clock.now_ns + round(seconds * SECOND_NS))

    def until(self, condition: Callable[[], object], within_s: float) -> bool:
        """Whether it comes to be so within this simulated time."""
        end_ns = self.clock.now_ns + round(within_s * SECOND_NS)
        while not condition() and self.clock.now_ns < end_ns:
            self.run(0.01)
        return bool(condition())

    def states(self) -> dict[str, RuleState]:
        """The worst of each rule's inputs."""
        return {
            name: max(watcher.state for watcher in wiring.watchers) for name, wiring in self._wirings.items()
        }

    def reasons(self, name: str) -> list[str]:
        """Why a rule has tripped."""
        return [change.reason for _at_s, rule, change in self.changes if rule == name and change.acts]

    def _changed(self, name: str, _watcher: Watcher, change: RuleTransition) -> None:
        self.changes.append((self.clock.now_s, name, change))

    def _look(self) -> None:
        for watcher in itertools.chain(*(wiring.watchers for wiring in self._wirings.values())):
            watcher.look(self.now_ns())

    def _replace(self, monkeypatch: pytest.MonkeyPatch) -> None:
        ours = [
            module for name, module in sys.modules.items() if name.startswith(("drivers.", "gateway.guard."))
        ]
        for module in ours:
            if getattr(module, "time", None) is time:
                monkeypatch.setattr(module, "time", Time(self.clock))
        self._ports: dict[str, DirectPort] = {}
        make = partial(DirectPort, ports=self._ports, now_ns=self.now_ns)
        monkeypatch.setattr("drivers.line.SerialPort", make)
        monkeypatch.setattr("gateway.modules.component.assembly.CanBus", DirectBus)

    def _config(self, folder: Path, rules: str) -> RobotConfig:
        text = robot_file.text(folder, robot_file.virtual_bus("none"), self.simulated)
        files = {"robot.toml": f"{text}\n{rules}", **companions(self.simulated.sensors.choice)}
        for name, content in files.items():
            (folder / name).write_text(content, encoding="utf-8")
        return load(folder / "robot.toml")

    def _assemble(self, config: RobotConfig) -> Robot:
        robot = assemble(config)
        assert not robot.absent
        for bus in robot.buses.values():
            cast("DirectBus", bus).join(self.simulated, self.now_ns)
            for node_id, node in bus.nodes.items():
                worker = DirectWorker(DirectSdo(node_id, self.simulated), self.clock)
                vars(node)["worker"] = worker
                for part in (vars(node)["_booting"], vars(node)["_asking"]):
                    vars(part)["_worker"] = worker
        for name, line in self.simulated.sensors.lines.items():
            line.port = self._ports[name]
        return robot
