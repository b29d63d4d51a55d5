"""Mistakes between the tables of a robot's file, each with table, key and remedy.

Tables that could not be read are told already: what names them is not wrong for that (`RobotConfig.names`).
"""

from collections.abc import Iterator

from drivers.bus.interfaces.opening import interfaces, is_interface
from drivers.imu.rotation import from_axes
from drivers.imu.settings import CanImuSettings, ImuSettings
from drivers.insole.settings import InsoleSettings
from drivers.insole.shipped import shipped_names
from drivers.joint.settings import JointSettings
from gateway.config.channel_checks import complaints as about_channels
from gateway.config.likelihood import warnings
from gateway.config.parameter_checks import complaints as about_parameters
from gateway.config.robot import COMPONENT_TABLES, NAME, RobotConfig, header
from gateway.config.sdo_checks import complaints as about_sdo
from gateway.config.stop import Fallback
from gateway.tables.finding import Finding, meant, unknown

RESERVED_NAMES = ("resource", "status", "robot", "guard")


def complaints(config: RobotConfig) -> Iterator[Finding]:
    """Everything that is wrong with the file, then what likely is."""
    for check in _CHECKS:
        yield from check(config)
    if config.guard is not None:
        from gateway.config.guard_checks import complaints as about_guard  # for who has one only

        yield from about_guard(config, config.guard)
    yield from warnings(config)


def _about_names(config: RobotConfig) -> Iterator[Finding]:
    seen: dict[str, str] = {}
    for table in COMPONENT_TABLES:
        for name in config.names(table):
            where = header(table, name)
            if not NAME.fullmatch(name):
                yield Finding(where, "", "a name is a letter, then letters, digits, _ and -")
            if name in RESERVED_NAMES:
                yield Finding(where, "", f"the name {name!r} is taken by the gateway itself; choose another")
            if name in seen:
                yield Finding(where, "", f"the name {name!r} is that of [{seen[name]}.{name}] too")
            seen[name] = table


def _about_listening(config: RobotConfig) -> Iterator[Finding]:
    host, port = config.gateway.host, config.gateway.port
    if "/" in host or host.count(":") == 1:
        text = f'{host!r} is more than a host: write one such as "127.0.0.1", and its port into the key port'
        yield Finding("[gateway]", "host", text)
    if port and config.gateway.classic_port == port:
        yield Finding(
            "[gateway]", "classic_port", f"{port} is port already; take another, such as {port + 1}"
        )


def _about_buses(config: RobotConfig) -> Iterator[Finding]:
    for name, bus in config.can.items():
        if not is_interface(bus.interface):
            yield Finding(header("can", name), "interface", unknown(bus.interface, interfaces()))
        if bus.network is not None and not bus.trusted_network:
            text = (
                f"goes over {bus.network}, and whoever is on that network can command the drives: write "
                "trusted_network = true where nobody else is on it, or take a bus of this computer"
            )
            yield Finding(header("can", name), "interface", text)


def no_bus(config: RobotConfig, where: str, bus: str) -> Iterator[Finding]:
    """Yield a finding if there is no bus of this name."""
    buses = config.names("can")
    if bus not in buses:
        known = ", ".join(buses) or "none"
        text = f"there is no bus {bus!r}: {meant(bus, buses)}[can.NAME] tables here: {known}"
        yield Finding(where, "bus", text)


def _about_nodes(config: RobotConfig) -> Iterator[Finding]:
    seen: dict[tuple[str, int, int | None], str] = {}
    whole: dict[tuple[str, int], str] = {}  # who is on a node, whatever its axis
    own = {
        (name, bus.node_id): f"[can.{name}]" for name, bus in config.can.items() if bus.node_id is not None
    }
    for where, settings in config.on_buses():
        yield from no_bus(config, where, settings.bus)
        if isinstance(settings, CanImuSettings):
            continue
        node = (settings.bus, settings.node_id)
        axis = settings.axis if isinstance(settings, JointSettings) else None
        other = seen.get((*node, axis)) or own.get(node) or (whole.get(node) if axis is None else None)
        if other:
            remedy = (
                "; two joints of one drive differ in axis" if axis is not None and node not in own else ""
            )
            text = f"{settings.node_id} on bus {settings.bus!r} belongs to {other}{remedy}"
            yield Finding(where, "node_id", text)
        seen[(*node, axis)] = where
        whole[node] = where


def _about_ports(config: RobotConfig) -> Iterator[Finding]:
    insoles: dict[str, tuple[str, InsoleSettings]] = {}
    taken: dict[str, str] = {}
    for where, sensor in config.on_ports():
        if not sensor.port:
            yield Finding(where, "port", "is empty: write the port's path, in /dev/serial/by-id")
    for name, insole in config.insole.items():
        where = header("insole", name)
        other, same = insoles.setdefault(insole.port, (where, insole))
        if (insole.baudrate, insole.format) != (same.baudrate, same.format):
            text = f"{insole.port!r} is shared with {other}: same baudrate and format, please"
            yield Finding(where, "port", text)
        taken[insole.port] = where
    for name, imu in config.imu.items():
        if not isinstance(imu, ImuSettings):
            continue
        where = header("imu", name)
        if imu.port in taken:
            text = f"{imu.port!r} is in use by {taken[imu.port]}; each sensor has its own port"
            yield Finding(where, "port", text)
        taken[imu.port] = where


def _about_feet(config: RobotConfig) -> Iterator[Finding]:
    seen: dict[str, str] = {}
    for name, insole in config.insole.items():
        foot = insole.side(name)
        where = header("insole", name)
        if foot is not None and seen.setdefault(foot, where) != where:
            yield Finding(where, "foot", f"this is a {foot} foot, as {seen[foot]} is: say which is which")


def _about_layouts(config: RobotConfig) -> Iterator[Finding]:
    for name, insole in config.insole.items():
        if insole.layout is None or insole.layout.endswith(".toml"):
            continue
        if insole.layout not in (known := shipped_names()):
            text = f"{unknown(insole.layout, known)}, or a .toml file"
            yield Finding(header("insole", name), "layout", text)


def _about_axes(config: RobotConfig) -> Iterator[Finding]:
    for name, imu in config.imu.items():
        try:
            from_axes(imu.axes or ("x", "y", "z"))
        except ValueError as error:
            yield Finding(header("imu", name), "axes", str(error).removeprefix("axes "))


def _about_silence(config: RobotConfig) -> Iterator[Finding]:
    for table in COMPONENT_TABLES:
        for name, one in getattr(config, table).items():
            if one.stale_after_s > one.lost_after_s:
                text = f"{one.stale_after_s:g} is above lost_after_s {one.lost_after_s:g}: stale comes first"
                yield Finding(header(table, name), "stale_after_s", text)


def _about_control_loop(config: RobotConfig) -> Iterator[Finding]:
    loop = config.control_loop
    if loop is None:
        return
    if not all(name.strip() for name in loop.processes):
        yield Finding("[control_loop]", "processes", 'one is empty: write names as `ps` shows them, ["walk"]')
    if loop.bus is not None:
        yield from no_bus(config, "[control_loop]", loop.bus)
    if (loop.bus is None) != (loop.period_ms is None):
        missing = "bus" if loop.bus is None else "period_ms"
        text = "bus and period_ms belong together: on which bus its frames come, and how often"
        yield Finding("[control_loop]", missing, text)


def _about_stop(config: RobotConfig) -> Iterator[Finding]:
    stop = config.stop
    if list(stop.fallback) != [one for one in Fallback if one in stop.fallback]:
        order = ", ".join(f'"{one}"' for one in Fallback)
        text = f"each once, NMT stop last because it silences the drive: {order}"
        yield Finding("[stop]", "fallback", text)
    devices = config.names("device")
    for number, controller in enumerate(stop.controller, 1):
        where = f"[[stop.controller]] number {number}"
        if controller.component not in devices:
            known = ", ".join(devices) or "none"
            wrong = f"there is no [device.{controller.component}]"
            text = f"{wrong}: {meant(controller.component, devices)}here are {known}"
            yield Finding(where, "component", text)
        if controller.address[1] > 0xFF:
            yield Finding(where, "object", "the subindex goes from 0 to 255")


_CHECKS = (
    _about_names,
    _about_listening,
    _about_buses,
    _about_nodes,
    about_sdo,
    _about_ports,
    _about_feet,
    _about_layouts,
    _about_axes,
    _about_silence,
    about_parameters,
    about_channels,
    _about_stop,
    _about_control_loop,
)
