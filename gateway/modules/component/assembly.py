"""Builds a robot's buses and components from its file; what cannot be built is named and left out."""

import gc
import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import eds
from drivers.bus.bus import CanBus
from drivers.bus.device import CanDevice
from drivers.bus.opening import needs_python_can
from drivers.component import Component, Kind
from drivers.errors import DriverError
from drivers.imu.build import build_imu
from drivers.imu.inclinometer import Inclinometer
from drivers.imu.settings import MountedSettings
from drivers.insole.device import Insole, line_for, pair
from drivers.insole.settings import InsoleSettings
from drivers.joint.drive import JointDrive
from gateway.config import RobotConfig
from gateway.process.lean import standing_in, without

T = TypeVar("T")


@dataclass(slots=True)
class Robot:
    """What could be built, and why the rest could not."""

    buses: dict[str, CanBus] = field(default_factory=dict)
    components: dict[str, Component] = field(default_factory=dict)
    descriptions: dict[str, eds.Description] = field(default_factory=dict)
    absent: dict[str, tuple[Kind, str]] = field(default_factory=dict)  # component → kind, why it is not there


def assemble(config: RobotConfig) -> Robot:
    """Build everything that the file names; nothing is opened yet."""
    robot = Robot()
    if config.can:
        _import_canopen(with_can=any(map(needs_python_can, config.can.values())))
        gc.freeze()  # so that what is collected below is looked for among little
    for name, settings in config.can.items():
        robot.buses[name] = CanBus(name, settings, config.gateway.role, urgent=config.guard is not None)
    for kind, devices in ((Kind.JOINT, config.joint), (Kind.DEVICE, config.device)):
        for name, device in devices.items():
            _add(robot, kind, name, _can_component(robot, config.path, kind, name, device))
    lines: dict[str, Any] = {}
    for name, insole in config.insole.items():
        _add(robot, Kind.INSOLE, name, _insole(config.path, name, insole, lines))
    feet = [one for one in robot.components.values() if isinstance(one, Insole)]
    pair(feet)
    for foot in feet:
        if (hip := robot.components.get(f"{foot.foot}_hip")) is not None:
            foot.follow_hip(hip.latest)
    for name, imu in config.imu.items():
        _add(robot, Kind.IMU, name, _imu(robot, config.path, name, imu))
    return robot


def _import_canopen(*, with_can: bool) -> None:
    """It reads EDS files. Without python-can, where no bus is opened by that: 10 MB, and 40 ms of a stop."""
    with without("ssl", "_hashlib"):  # OpenSSL: 5 MB
        if with_can:
            importlib.import_module("can")
        with standing_in("can"):
            importlib.import_module("canopen")


def _add(robot: Robot, kind: Kind, name: str, build: Callable[[], Component]) -> None:
    try:
        robot.components[name] = build()
    except (DriverError, eds.EdsError, OSError) as error:
        robot.absent[name] = (kind, str(error))
    except Exception as error:  # noqa: BLE001 - one device's fault must not take the others with it
        robot.absent[name] = (kind, f"internal error, {type(error).__name__}: {error}; report it")


def _can_component(robot: Robot, path: Path, kind: Kind, name: str, settings: Any) -> Callable[[], Component]:
    def build() -> Component:
        description = eds.load(eds.locate(settings.eds, path), settings.node_id)
        if all(description.path != known.path for known in robot.descriptions.values()):
            gc.collect()  # what reading a file leaves is larger than what it gives, and would lie there long
        robot.descriptions[name] = description
        make = JointDrive if kind is Kind.JOINT else CanDevice
        return make(name, settings, robot.buses[settings.bus], description)

    return build


def _insole(
    path: Path, name: str, settings: InsoleSettings, lines: dict[str, Any]
) -> Callable[[], Component]:
    def build() -> Component:
        if settings.port not in lines:
            lines[settings.port] = line_for(settings, path.parent)
        return Insole(name, settings, lines[settings.port], path.parent)

    return build


def _imu(robot: Robot, path: Path, name: str, settings: MountedSettings) -> Callable[[], Component]:
    def build() -> Component:
        imu = build_imu(name, settings, robot.buses, path)
        if isinstance(imu, Inclinometer):
            robot.descriptions[name] = imu.node.description
        return imu

    return build


def facts(config: RobotConfig, name: str, description: eds.Description) -> Mapping[str, str | int]:
    """What `robot.describe` tells of a device: what its EDS says, and where it is."""
    tables: dict[str, Any] = {**config.joint, **config.device, **config.imu}
    bus, bitrate = tables[name].bus, config.can[tables[name].bus].bitrate
    found: dict[str, str | int] = {
        "eds": description.path.name,
        "vendor": description.vendor,
        "product": description.product,
        "bus": bus,
        "node_id": tables[name].node_id,
    }
    if bitrate is not None:
        found["bitrate"] = bitrate
    warnings = [f"{one.where}: {one.text}" for one in description.findings if one.severity == "warning"]
    if warnings:
        found["warnings"] = "; ".join(warnings)
    return found
