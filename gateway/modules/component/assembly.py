"""Builds a robot's buses and components from its file; what cannot be built is named and left out."""

import gc
import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import eds
from drivers.build_context import BuildContext
from drivers.bus.bus import CanBus
from drivers.bus.device import CanDevice
from drivers.bus.interfaces.opening import needs_python_can
from drivers.bus.settings import DeviceSettings
from drivers.component import Component, ComponentKind
from drivers.errors import DriverError
from drivers.imu.build import build_imu
from drivers.insole.build import build_insole, join_insoles
from drivers.joint.drive import JointDrive
from drivers.joint.leg_pairs import join_joints
from drivers.joint.settings import JointSettings
from eds.light_imports import import_canopen, without
from eds.profile import profile_of
from gateway.config.robot import RobotConfig

T = TypeVar("T")


@dataclass(slots=True)
class Robot:
    """The components that could be built, and the reasons for the rest."""

    buses: dict[str, CanBus] = field(default_factory=dict)
    components: dict[str, Component] = field(default_factory=dict)
    descriptions: dict[str, eds.Description] = field(default_factory=dict)
    absent: dict[str, tuple[ComponentKind, str]] = field(
        default_factory=dict
    )  # component → kind, why it is not there


@dataclass(frozen=True, slots=True)
class Builder:
    """Builder of one kind of components from their tables; `join` introduces them to all others."""

    build: Callable[[str, Any, BuildContext], Component]
    join: Callable[[Mapping[str, Component]], None] | None = None


def assemble(config: RobotConfig) -> Robot:
    """Build everything that the file names; nothing is opened yet."""
    robot = Robot()
    if config.can:
        _import_canopen(with_can=any(map(needs_python_can, config.can.values())))
        gc.freeze()  # so that what is collected below is looked for among little
    for name, settings in config.can.items():
        robot.buses[name] = CanBus(name, settings, config.gateway.role, urgent=config.guard is not None)
    chosen = {name: config.channels_of(name) for name in (*config.joint, *config.device)}
    site = BuildContext(
        config.path, robot.buses, descriptions=robot.descriptions, channels=chosen, recognise=_format_of
    )
    for kind, builder in BUILDERS.items():
        for name, settings in getattr(config, kind).items():
            _add(robot, kind, name, partial(builder.build, name, settings, site))
    for builder in BUILDERS.values():
        if builder.join is not None:
            builder.join(robot.components)
    return robot


def _format_of(data: bytes) -> str | None:
    from drivers import identify  # imports every format: for a line that nobody understands only

    return identify.format_of(data)


def _import_canopen(*, with_can: bool) -> None:
    """Without python-can, where no bus is opened by that: 40 ms of a stop."""
    with without("ssl", "_hashlib"):  # OpenSSL: 5 MB
        if with_can:
            importlib.import_module("can")
        import_canopen()


def _add(robot: Robot, kind: ComponentKind, name: str, build: Callable[[], Component]) -> None:
    try:
        robot.components[name] = build()
    except (DriverError, eds.EdsError, OSError) as error:
        robot.absent[name] = (kind, str(error))
    except Exception as error:  # noqa: BLE001 - one device's fault must not take the others with it
        robot.absent[name] = (kind, f"internal error, {type(error).__name__}: {error}; report it")


def _on_can(
    make: Callable[..., Component], join: Callable[[Mapping[str, Component]], None] | None = None
) -> Builder:
    """Return the builder of what a vendor's EDS describes."""

    def build(name: str, settings: JointSettings | DeviceSettings, site: BuildContext) -> Component:
        description = eds.load(eds.locate(settings.eds, site.file), settings.node_id)
        if all(description.path != known.path for known in site.descriptions.values()):
            gc.collect()  # what reading a file leaves is larger than what it gives, and would lie there long
        site.descriptions[name] = description
        chosen = site.channels.get(name, {})
        return make(name, settings, site.buses[settings.bus], description, chosen)

    return Builder(build, join)


BUILDERS: Mapping[ComponentKind, Builder] = {
    ComponentKind.JOINT: _on_can(JointDrive, join_joints),
    ComponentKind.DEVICE: _on_can(CanDevice),
    ComponentKind.INSOLE: Builder(build_insole, join_insoles),
    ComponentKind.IMU: Builder(build_imu),
}


def facts(config: RobotConfig, name: str, description: eds.Description) -> Mapping[str, str | int]:
    """Return the device facts of `robot.describe`: those of its EDS, and its place."""
    tables: dict[str, Any] = {name: one for kind in BUILDERS for name, one in getattr(config, kind).items()}
    bus, bitrate = tables[name].bus, config.can[tables[name].bus].bitrate
    found: dict[str, str | int] = {
        "eds": description.path.name,
        "eds_digest": description.digest,
        "vendor": description.vendor,
        "product": description.product,
        "bus": bus,
        "node_id": tables[name].node_id,
    }
    if bitrate is not None:
        found["bitrate"] = bitrate
    profile = profile_of(description)
    if profile is not None:
        found["profile"] = profile.name
        if profile.quirks:
            found["quirks"] = "; ".join(one.text for one in profile.quirks)
    warnings = [f"{one.where}: {one.text}" for one in description.findings if one.severity == "warning"]
    if warnings:
        found["warnings"] = "; ".join(warnings)
    return found
