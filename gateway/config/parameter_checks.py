"""Mistakes in `[parameter."component.name"]`, and in the `release` of a joint or device."""

from collections.abc import Iterator

from drivers.joint.cia402 import STATE_WORDS
from gateway.config.objects import AXIS_OFFSET, CONTROLWORD, RESTORE, STORE
from gateway.config.robot import (
    DeviceTable,
    JointTable,
    Node,
    ParameterSettings,
    RobotConfig,
    header,
)
from gateway.tables.finding import Finding, meant, unknown


def complaints(config: RobotConfig) -> Iterator[Finding]:
    """Everything that is wrong with them."""
    for table, devices in (("joint", config.joint), ("device", config.device)):
        for name, device in devices.items():
            yield from _about_release(header(table, name), name, device)
    for name, parameter in config.parameter.items():
        where = header("parameter", name)
        yield from _about_name(config, where, name)
        yield from _about_object(where, parameter)
        yield from _about_limits(where, parameter)
        for state in parameter.states or ():
            if state not in STATE_WORDS.values():
                yield Finding(where, "states", f"drive state {unknown(state, STATE_WORDS.values())}")
    yield from _about_same_objects(config)


def _about_release(where: str, name: str, device: JointTable | DeviceTable) -> Iterator[Finding]:
    if device.release and device.parameters is None:
        yield Finding(where, "release", 'there is nothing to release without parameters = "eds"')
    for entry in device.release:
        if entry.startswith(f"{name}."):
            text = f"write {entry.removeprefix(f'{name}.')!r}, without the table's own name"
            yield Finding(where, "release", text)


def _about_name(config: RobotConfig, where: str, name: str) -> Iterator[Finding]:
    component, dot, quantity = name.partition(".")
    if not (dot and quantity):
        yield Finding(where, "", 'a parameter is called "component.name"')
    owners = config.names("joint", "device")
    if component not in owners:
        known = ", ".join(owners) or "none"
        text = f"there is no joint or device {component!r}: {meant(component, owners)}here are {known}"
        yield Finding(where, "", text)


def _about_object(where: str, parameter: ParameterSettings) -> Iterator[Finding]:
    index, subindex = parameter.address
    if subindex > 0xFF:
        yield Finding(where, "object", "the subindex goes from 0 to 255")
    if index in range(CONTROLWORD, 0xA000, AXIS_OFFSET):
        text = f"{parameter.object} is a controlword: it enables drives and is no parameter"
        yield Finding(where, "object", text)
    if index in (STORE, RESTORE):
        text = f"{parameter.object} is a command; use gwrms store and gwrms restore"
        yield Finding(where, "object", text)


def _about_limits(where: str, parameter: ParameterSettings) -> Iterator[Finding]:
    low, high = parameter.min, parameter.max
    if parameter.scale == 0:
        yield Finding(where, "scale", "0 would make every value 0")
    if low is not None and high is not None and low > high:
        thousandth = low / 1000.0
        slip = f"; {low:g} mm is {thousandth:g} m" if parameter.unit == "m" and thousandth <= high else ""
        yield Finding(where, "min", f"{low:g} is above max {high:g}{slip}")


def _about_same_objects(config: RobotConfig) -> Iterator[Finding]:
    """Two names, each with limits of its own, would let one write what the other one forbids."""
    seen: dict[tuple[Node, tuple[int, int]], str] = {}
    for name, parameter in config.parameter.items():
        where, component = header("parameter", name), name.partition(".")[0]
        if component not in config.joint and component not in config.device:
            continue
        node = config.node_of(component)
        other = seen.setdefault((node, parameter.address), where)
        if other != where:
            text = (
                f"{parameter.object} of node {node[1]} on bus {node[0]!r} is {other} "
                "already; keep one of the two tables"
            )
            yield Finding(where, "object", text)
