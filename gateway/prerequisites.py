"""Prerequisites of a robot's file: devices' files, and this computer's address, ports and CAN links.

Nothing is opened for use: a gateway may be running. What is missing may come, so it is only warned of; a file
that cannot be used is a mistake.
"""

import os
import socket
from collections.abc import Callable, Iterator

from drivers.bus.channels import objection
from drivers.bus.interfaces.opening import obstacle as bus_obstacle
from drivers.joint.quantities import AXIS_OFFSET
from drivers.port import obstacle as port_obstacle
from eds.report import ratio
from gateway.coding import CodingError
from gateway.config.robot import RobotConfig, header
from gateway.modules.component.assembly import Robot, assemble
from gateway.modules.control.catalogue import resolve
from gateway.modules.control.parameters import WRITABLE, Parameter
from gateway.modules.stop.controllers import write_of
from gateway.tables.finding import Finding, warning

_FAR_OFF = 10.0


def beside(config: RobotConfig) -> Iterator[Finding]:
    """Yield mistakes in the files that it names, and limits that contradict the EDS."""
    robot = assemble(config)
    for name, (kind, why) in robot.absent.items():
        yield Finding(header(kind, name), "", why.removeprefix(f"{header(kind, name)}: "))
    yield from _about_scaling(config, robot)
    absent = {name: why for name, (_kind, why) in robot.absent.items()}
    for parameter in resolve(config, robot.descriptions, absent).values():
        if parameter.component not in absent:
            yield from _about_parameter(config, robot, parameter)
    yield from _about_channels(config, robot)
    yield from _about_controllers(config, robot)


def here(config: RobotConfig) -> Iterator[Finding]:
    """Yield what this computer lacks, and its deviations from the file."""
    for check in _HERE:
        yield from check(config)


def _about_parameter(config: RobotConfig, robot: Robot, parameter: Parameter) -> Iterator[Finding]:
    settings = config.parameter.get(parameter.name)
    if settings is None:  # offered by the EDS alone
        if parameter.problem is not None:
            yield warning(_table(config, parameter.component), "", parameter.problem)
        return
    where = header("parameter", parameter.name)
    if parameter.problem is not None:
        yield Finding(where, "", parameter.problem)
        return
    file = robot.descriptions[parameter.component].path.name
    for key, own, counts in (("min", settings.min, parameter.min), ("max", settings.max, parameter.max)):
        if own is not None and counts is not None and own != counts:
            text = f"{own:g} is beyond {file}, where it is {counts:g}: that counts"
            yield warning(where, key, text)


def _about_channels(config: RobotConfig, robot: Robot) -> Iterator[Finding]:
    for name, one in config.channel.items():
        description = robot.descriptions.get(name.partition(".")[0])
        why = None if description is None else objection(one, description)
        if why is not None:
            yield Finding(header("channel", name), "object", why)


def _about_scaling(config: RobotConfig, robot: Robot) -> Iterator[Finding]:
    """Yield scaling factors far from the EDS's defaults; the drive's own values are read later."""
    for name, joint in config.joint.items():
        description = robot.descriptions.get(name)
        if description is None:
            continue
        for key, index, own in (
            ("counts_per_revolution", 0x608F, joint.counts_per_revolution),
            ("gear_ratio", 0x6091, joint.gear_ratio),
        ):
            told = ratio(description, index + joint.axis * AXIS_OFFSET)
            if told is not None and not 1 / _FAR_OFF < own / told < _FAR_OFF:
                file = description.path.name
                text = f"{own:g} is far from {told:g}, as {file} has it in {index:X}h: angles are off by that"
                yield warning(header("joint", name), key, text)


def _about_controllers(config: RobotConfig, robot: Robot) -> Iterator[Finding]:
    """Else it is first seen when somebody stops the robot."""
    for number, one in enumerate(config.stop.controller, 1):
        description = robot.descriptions.get(one.component)
        if description is None:
            continue  # why is told of its own table
        where, file = f"[[stop.controller]] number {number}", description.path.name
        try:
            write_of(one, description)
        except CodingError as error:
            yield Finding(where, "object", f"{one.object} of {file}: {error}; a stop could not stop it")
            continue
        variable = description.variable(*one.address)
        if variable is not None and variable.access_type.lower() not in WRITABLE:
            text = f"{one.object} cannot be written, says {file}: a stop would not stop it"
            yield warning(where, "object", text)


def _table(config: RobotConfig, component: str) -> str:
    return header("joint" if component in config.joint else "device", component)


def _about_address(config: RobotConfig) -> Iterator[Finding]:
    host = config.gateway.host
    try:
        found = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, kind, protocol, _, address = found[0]
        with socket.socket(family, kind, protocol) as tried:
            tried.bind(address)
    except OSError as error:
        reason = error.strerror or str(error)
        yield warning("[gateway]", "host", f"{host} is no address of this computer: {reason}")


def _about_ports(config: RobotConfig) -> Iterator[Finding]:
    for where, sensor in config.on_ports():
        why = port_obstacle(sensor.port)
        if why is not None:
            yield warning(where, "port", why)


def _about_buses(config: RobotConfig) -> Iterator[Finding]:
    for name, bus in config.can.items():
        why = bus_obstacle(bus)
        if why is not None:
            yield warning(header("can", name), "channel", why)


def _about_records(config: RobotConfig) -> Iterator[Finding]:
    folder = config.records
    there = next(one for one in (folder, *folder.parents) if one.exists())
    if not there.is_dir():
        yield warning("[gateway]", "records", f"{there} is no folder: journal and held stop would be lost")
    elif not os.access(there, os.W_OK):
        text = f"{folder} cannot be written by this user: journal and held stop would be lost"
        yield warning("[gateway]", "records", text)


_HERE: tuple[Callable[[RobotConfig], Iterator[Finding]], ...] = (
    _about_address,
    _about_ports,
    _about_buses,
    _about_records,
)
