"""What cannot work in a robot's file though each of its tables can be read, in words with table and key."""

import math
from collections.abc import Iterator

from drivers.imu.settings import CanImuSettings, ImuSettings
from drivers.insole.settings import InsoleSettings
from drivers.joint.cia402 import STATE_WORDS
from drivers.joint.settings import JointSettings
from gateway.config.objects import AXIS_OFFSET, CONTROLWORD, RESTORE, STORE
from gateway.config.robot import (
    COMPONENT_TABLES,
    NAME,
    ControlLoopSettings,
    DeviceTable,
    JointTable,
    Node,
    ParameterSettings,
    RobotConfig,
    header,
)
from gateway.config.sdo_checks import complaints as about_sdo
from gateway.config.stop import Fallback, StopSettings

RESERVED_NAMES = ("resource", "status", "robot", "guard")


def complaints(config: RobotConfig) -> Iterator[str]:
    """Everything that is wrong with the file, in words with table, key and what to do."""
    yield from _about_names(config)
    yield from _about_nodes(config)
    yield from about_sdo(config)
    yield from _about_ports(config)
    for table, devices in (("joint", config.joint), ("device", config.device)):
        for name, device in devices.items():
            yield from _about_release(header(table, name), name, device)
    for name, parameter in config.parameter.items():
        yield from _about_parameter(config, name, parameter)
    yield from _about_same_objects(config)
    yield from _about_stop(config, config.stop)
    if config.control_loop is not None:
        yield from _about_control_loop(config, config.control_loop)
    if config.guard is not None:
        from gateway.config.guard_checks import complaints as about_guard  # for who has one only

        yield from about_guard(config, config.guard)


def _about_names(config: RobotConfig) -> Iterator[str]:
    seen: dict[str, str] = {}
    for table in COMPONENT_TABLES:
        for name in getattr(config, table):
            if not NAME.fullmatch(name):
                yield f"{header(table, name)}: a name is a letter, then letters, digits, _ and -"
            if name in RESERVED_NAMES:
                yield f"[{table}.{name}]: the name {name!r} is taken by the gateway itself; choose another"
            if name in seen:
                yield f"[{table}.{name}]: the name {name!r} is that of [{seen[name]}.{name}] too"
            seen[name] = table


def _about_nodes(config: RobotConfig) -> Iterator[str]:
    seen: dict[tuple[str, int, int | None], str] = {}
    whole: dict[tuple[str, int], str] = {}  # who is on a node, whatever its axis
    own = {
        (name, bus.node_id): f"[can.{name}]" for name, bus in config.can.items() if bus.node_id is not None
    }
    for where, settings in config.on_buses():
        if settings.bus not in config.can:
            known = ", ".join(config.can) or "none"
            yield f"{where} bus: there is no bus {settings.bus!r}; [can.NAME] tables here: {known}"
        if isinstance(settings, CanImuSettings):
            continue
        node = (settings.bus, settings.node_id)
        axis = settings.axis if isinstance(settings, JointSettings) else None
        other = seen.get((*node, axis)) or own.get(node) or (whole.get(node) if axis is None else None)
        if other:
            yield f"{where} node_id: {settings.node_id} on bus {settings.bus!r} belongs to {other}"
        seen[(*node, axis)] = where
        whole[node] = where


def _about_ports(config: RobotConfig) -> Iterator[str]:
    insoles: dict[str, tuple[str, InsoleSettings]] = {}
    taken: dict[str, str] = {}
    for name, insole in config.insole.items():
        where = f"[insole.{name}]"
        other, same = insoles.setdefault(insole.port, (where, insole))
        if (insole.baudrate, insole.format) != (same.baudrate, same.format):
            yield f"{where} port: {insole.port!r} is shared with {other}: same baudrate and format, please"
        taken[insole.port] = where
    for name, imu in config.imu.items():
        if not isinstance(imu, ImuSettings):
            continue
        where = f"[imu.{name}]"
        if imu.port in taken:
            yield f"{where} port: {imu.port!r} is in use by {taken[imu.port]}; each sensor has its own port"
        taken[imu.port] = where


def _about_control_loop(config: RobotConfig, loop: ControlLoopSettings) -> Iterator[str]:
    if loop.bus is not None and loop.bus not in config.can:
        known = ", ".join(config.can) or "none"
        yield f"[control_loop] bus: there is no bus {loop.bus!r}; [can.NAME] tables here: {known}"
    if (loop.bus is None) != (loop.period_ms is None):
        yield "[control_loop] bus and period_ms belong together: on which bus its frames come, and how often"


def _about_release(where: str, name: str, device: JointTable | DeviceTable) -> Iterator[str]:
    if device.release and device.parameters is None:
        yield f'{where} release: there is nothing to release without parameters = "eds"'
    for entry in device.release:
        if entry.startswith(f"{name}."):
            yield f"{where} release: write {entry.removeprefix(f'{name}.')!r}, without the table's own name"


def _about_same_objects(config: RobotConfig) -> Iterator[str]:
    """Two names, each with limits of its own, would let one write what the other one forbids."""
    seen: dict[tuple[Node, tuple[int, int]], str] = {}
    for name, parameter in config.parameter.items():
        where = header("parameter", name)
        node = config.node_of(name.partition(".")[0])
        other = seen.setdefault((node, parameter.address), where)
        if other != where:
            yield (
                f"{where} object: {parameter.object} of node {node[1]} on bus {node[0]!r} is {other} "
                "already; keep one of the two tables"
            )


def _about_parameter(config: RobotConfig, name: str, parameter: ParameterSettings) -> Iterator[str]:
    where = header("parameter", name)
    component, dot, quantity = name.partition(".")
    if not (dot and quantity):
        yield f'{where}: a parameter is called "component.name"'
    if component not in config.joint and component not in config.device:
        known = ", ".join([*config.joint, *config.device]) or "none"
        yield f"{where}: there is no joint or device {component!r}; here are {known}"
    index, subindex = parameter.address
    if subindex > 0xFF:
        yield f"{where} object: the subindex goes from 0 to 255"
    if index in range(CONTROLWORD, 0xA000, AXIS_OFFSET):
        yield f"{where} object: {parameter.object} is a controlword: it enables drives and is no parameter"
    if index in (STORE, RESTORE):
        yield f"{where} object: {parameter.object} is a command; use gwrms store and gwrms restore"
    numbers = {
        "scale": parameter.scale,
        "min": parameter.min,
        "max": parameter.max,
        "max_step": parameter.max_step,
    }
    for key, number in numbers.items():
        if number is not None and not math.isfinite(number):
            yield f"{where} {key}: {number} is no finite number"
    if parameter.scale == 0:
        yield f"{where} scale: 0 would make every value 0"
    if parameter.min is not None and parameter.max is not None and parameter.min > parameter.max:
        yield f"{where} min: {parameter.min} is above max {parameter.max}"
    for state in parameter.states or ():
        if state not in STATE_WORDS.values():
            known = ", ".join(STATE_WORDS.values())
            yield f"{where} states: there is no drive state {state!r}; allowed are {known}"


def _about_stop(config: RobotConfig, stop: StopSettings) -> Iterator[str]:
    if list(stop.fallback) != [one for one in Fallback if one in stop.fallback]:
        order = ", ".join(f'"{one}"' for one in Fallback)
        yield f"[stop] fallback: each once, NMT stop last because it silences the drive: {order}"
    for number, controller in enumerate(stop.controller, 1):
        where = f"[[stop.controller]] number {number}"
        if controller.component not in config.device:
            known = ", ".join(config.device) or "none"
            yield f"{where} component: there is no [device.{controller.component}]; here are {known}"
        if controller.address[1] > 0xFF:
            yield f"{where} object: the subindex goes from 0 to 255"
