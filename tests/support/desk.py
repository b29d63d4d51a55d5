"""A robot without a network: commands that are answered when the test says so, and what it would tell."""

import math
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

import pytest
from msgspec import UNSET, UnsetType
from msgspec.structs import replace

from gateway.client import Batch, ClockOffset, ConnectionState
from gateway.wire.component import ChannelInfo, ComponentInfo, LayoutInfo, QualityInfo, Snapshot
from gateway.wire.parameter import ParameterInfo, ParameterValue, ParameterValues
from gateway.wire.resource import (
    CpuUse,
    DiskUse,
    GatewayUse,
    MemoryUse,
    NetworkUse,
    ProcessUse,
    ResourceSnapshot,
    Throttling,
)
from gateway.wire.robot import Clock, Description, GuardInfo
from gateway.wire.stop import StopInfo
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import Described, Event, LinkChanged, Looked, Resources, Telemetry
from server_gui.core.tuning.commands import Commands

JOINTS = tuple(f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", "ankle"))
STATES = {"4": "operation enabled", "5": "quick stop active", "6": "switch on disabled", "7": "fault"}
UNITS = {"position": "rad", "velocity": "rad/s", "torque": "N·m", "current": "A", "temperature": "°C"}
HELD = {"gait.step_length": 0.4, "gait.trunk_angle": 0.05, "left_knee.max_torque": 80.0}


class FakeCommands:
    """Notes what is asked; each answer is a future that the test settles."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, tuple[Any, ...]]] = []
        self.futures: list[Future[Any]] = []
        self.dials = 0

    def _ask(self, name: str, *arguments: Any) -> "Future[Any]":
        self.asked.append((name, arguments))
        self.futures.append(Future())
        return self.futures[-1]

    def named(self, name: str) -> list[tuple[Any, ...]]:
        """The arguments of every call of this name."""
        return [arguments for known, arguments in self.asked if known == name]

    def answer(self, result: object) -> None:
        """Settle the latest."""
        self.futures[-1].set_result(result)

    def fail(self, error: Exception) -> None:
        """Let the latest fail."""
        self.futures[-1].set_exception(error)

    def stop(self, reason: str) -> "Future[Any]":
        return self._ask("stop", reason)

    def take_control(self) -> "Future[Any]":
        return self._ask("take_control")

    def release_control(self) -> "Future[Any]":
        return self._ask("release_control")

    def write(self, changes: Mapping[str, float], trial_s: float | None) -> "Future[Any]":
        return self._ask("write", dict(changes), trial_s)

    def confirm(self, write: int) -> "Future[Any]":
        return self._ask("confirm", write)

    def revert(self, write: int) -> "Future[Any]":
        return self._ask("revert", write)

    def read_back(self, name: str) -> "Future[Any]":
        return self._ask("read_back", name)

    def store(self, component: str) -> "Future[Any]":
        return self._ask("store", component)

    def reset(self) -> "Future[Any]":
        return self._ask("reset")

    def objects(self, component: str, search: str) -> "Future[Any]":
        return self._ask("objects", component, search)

    def read_objects(self, component: str, objects: Sequence[str]) -> "Future[Any]":
        return self._ask("read_objects", component, tuple(objects))

    def dial(self) -> None:
        self.dials += 1

    def show_processes(self, wanted: bool) -> None:
        self.asked.append(("show_processes", (wanted,)))


@dataclass
class Bench:
    """A desk, and the commands behind each of its robots."""

    desk: Desk
    commands: list[FakeCommands] = field(default_factory=list)

    def add(self, name: str, port: int = 7420) -> Station:
        """Another robot, linked."""
        commands = FakeCommands()
        as_commands: Commands = commands
        station = Station(name, f"127.0.0.1:{port}", as_commands, lambda call: call(), self.desk.news)
        station.take([LinkChanged(ConnectionState.CONNECTED, None, time.monotonic_ns())])
        self.commands.append(commands)
        self.desk.add(station)
        return station

    @property
    def station(self) -> Station:
        """The first robot."""
        return self.desk.stations[0]

    @property
    def first(self) -> FakeCommands:
        """What the first robot was asked."""
        return self.commands[0]

    def look_again(self, events: Sequence[Event]) -> None:
        """Take these, and look for news at once."""
        self.station._watched_ns = 0
        self.station.take(events)


def described(
    name: str = "exo-01",
    cells: int = 16,
    parameters: Mapping[str, float] = HELD,
    layout: LayoutInfo | UnsetType = UNSET,
) -> Described:
    """A robot with six joints, two insoles and an IMU."""
    components = [ComponentInfo(joint, "joint", "ok") for joint in JOINTS]
    components += [
        ComponentInfo(f"{side}_insole", "insole", "ok", layout=layout) for side in ("left", "right")
    ]
    components += [ComponentInfo("trunk", "imu", "ok"), ComponentInfo("gait", "device", "ok")]
    channels = [
        ChannelInfo(f"{joint}.{quantity}", unit, joint, quantity)
        for joint in JOINTS
        for quantity, unit in UNITS.items()
    ]
    channels += [ChannelInfo(f"{joint}.state", "", joint, "state", STATES) for joint in JOINTS]
    channels += [
        ChannelInfo(f"{side}_insole.{quantity}", unit, f"{side}_insole", quantity)
        for side in ("left", "right")
        for quantity, unit in [("force", "N"), *((f"cell_{number}", "Pa") for number in range(cells))]
    ]
    channels.append(ChannelInfo("trunk.tilt_forward", "rad", "trunk", "tilt_forward"))
    return Described(
        Description(
            robot=name,
            boot_id="boot-1",
            role="observer",
            components=components,
            channels=channels,
            parameters=[info(parameter) for parameter in parameters],
            modules={},
            clock=Clock(0, 0, "boot-1"),
            stop=StopInfo(held=False, reason=None, since_ns=None, stopped_again={}, drives={}),
            guard=GuardInfo(),
        )
    )


def info(name: str) -> ParameterInfo:
    """What a robot says of a parameter."""
    unit, low, high, step = {
        "gait.step_length": ("m", 0.2, 0.6, 0.1),
        "gait.trunk_angle": ("rad", -0.1, 0.3, 0.1),
    }.get(name, ("N·m", 8.0, 80.0, 40.0))
    component = name.partition(".")[0]
    return ParameterInfo(
        name,
        unit,
        low,
        high,
        step,
        True,
        None,
        component,
        "0x6072:0" if name.endswith("max_torque") else "0x2001:0",
        "rw",
        component != "gait",
        type="INTEGER32",
        scale=0.001,
        default=0.42 if component == "gait" else None,
    )


def looked(
    values: Mapping[str, float] = HELD,
    state: str = "ok",
    problem: str | None = None,
    at_ns: int | None = None,
) -> Looked:
    """The parameters as the robot holds them (at `at_ns`, by default now), its left knee in this state."""
    held = {
        name: ParameterValue(value, info(name).unit, info(name).min, info(name).max, 0)
        for name, value in values.items()
    }
    quality: dict[str, QualityInfo] = {"left_knee": {"state": state, "age_ms": 1.0, "problem": problem}}
    at_ns = time.monotonic_ns() if at_ns is None else at_ns
    return Looked(Snapshot(0, {}, {}, quality), ParameterValues(held), at_ns)


def walking(rows: int = 400, age_s: float = 0.0, cells: int = 16, rate_hz: float = 100.0) -> Telemetry:
    """The last rows of somebody who walks, a stride a second; the newest is `age_s` old."""
    received_ns = time.monotonic_ns() - round(age_s * 1e9)
    stamps_ns = [received_ns - round((rows - 1 - row) * 1e9 / rate_hz) for row in range(rows)]
    phases = [2 * math.pi * (stamp_ns / 1e9) for stamp_ns in stamps_ns]
    columns: dict[str, list[float | None]] = {}
    for joint in JOINTS:
        shift = 0.0 if joint.startswith("left") else math.pi
        columns[f"{joint}.position"] = [0.4 * math.sin(phase + shift) for phase in phases]
        for quantity in ("velocity", "torque", "current", "temperature"):
            columns[f"{joint}.{quantity}"] = [math.cos(phase + shift) for phase in phases]
        columns[f"{joint}.state"] = [4.0] * rows
    for side, shift in (("left", 0.0), ("right", math.pi)):
        load = [max(0.0, math.sin(phase + shift) + 0.2) for phase in phases]
        columns[f"{side}_insole.force"] = [700.0 * share for share in load]
        columns[f"{side}_insole.cop_x"] = [0.1 if share else None for share in load]
        columns[f"{side}_insole.cop_y"] = [0.0 if share else None for share in load]
        for number in range(cells):
            columns[f"{side}_insole.cell_{number}"] = [150_000.0 * share for share in load]
    columns["trunk.tilt_forward"] = [0.05] * rows
    return telemetry(stamps_ns, columns, received_ns)


def telemetry(
    stamps_ns: Sequence[int], columns: Mapping[str, list[float | None]], received_ns: int | None = None
) -> Telemetry:
    """A batch of these rows, from a robot whose clock is ours."""
    received_ns = time.monotonic_ns() if received_ns is None else received_ns
    batch = Batch(list(stamps_ns), dict(columns), 0, 0, 0, 1, received_ns)
    return Telemetry(1, batch, ClockOffset(0, 0))


def resources(processes: Sequence[ProcessUse] | None = None) -> Resources:
    """A look at the robot's computer."""
    snapshot = ResourceSnapshot(
        time.monotonic_ns(),
        CpuUse(21.5, [20.0, 23.0], [0.5, 0.4, 0.3]),
        MemoryUse(8 << 30, 6 << 30, 2 << 30, 0),
        GatewayUse(0.7, 15 << 20),
    )
    if processes is not None:
        snapshot = replace(
            snapshot,
            processes=list(processes),
            disk=DiskUse(20480.0, 4096.0),
            network=NetworkUse(1024.0, 65536.0),
            thermal={"cpu": 61.5, "board": None, "gpu": 48.0},
            throttling=Throttling(0, {"fan": 0.0}, [1.0, 0.8]),
        )
    return Resources(snapshot, 1_500_000, time.monotonic_ns())


def kinds(station: Station) -> list[Kind]:
    """What alarms it has, the worst first."""
    return [one.alarm.kind for one in station.alarms.active]


def walking_bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A desk with a robot that walks; what it has said gets old in a minute, on a busy computer as well."""
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 60_000_000_000)
    made = Bench(Desk())
    made.add("exo-01").take([described(), walking(50), looked()])
    return made
