"""Possible but unlikely values in a robot's file: warnings, each with the likely intention."""

import fnmatch
import math
import re
from collections.abc import Iterator, Mapping

from drivers.bus.settings import CanSettings, Role
from gateway.access.folder import AccessFolder
from gateway.config.robot import RobotConfig, header
from gateway.plain_text import LONGEST_NAME, NAME_SIGNS, ROBOT_SIGNS, is_name, is_robot_name
from gateway.tables.finding import Finding, meant, warning

BITRATES = (10_000, 20_000, 50_000, 83_333, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
BAUDRATES = frozenset(
    {1200, 2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200, 230_400, 250_000, 460_800, 500_000, 921_600}
    | {1_000_000, 1_500_000, 2_000_000, 3_000_000, 4_000_000}
)
# By unit: more than that is no quantity of an exoskeleton, which one it likely is, and its factor and offset.
_LARGEST: Mapping[str, tuple[float, str, float, float]] = {
    "rad": (6.2832, "°", math.pi / 180.0, 0.0),
    "m": (5.0, " mm", 1e-3, 0.0),
    "s": (600.0, " ms", 1e-3, 0.0),
    "rad/s": (100.0, "°/s", math.pi / 180.0, 0.0),
    "N·m": (2000.0, " mN·m", 1e-3, 0.0),
    "A": (500.0, " mA", 1e-3, 0.0),
    "V": (1500.0, " mV", 1e-3, 0.0),
    "°C": (250.0, " K", 1.0, -273.15),
}
_GEARS = (1.0, 1000.0)  # of a joint of an exoskeleton: direct drive up to several stages
_COUNTS = (16.0, 2.0**32)
_EVERYWHERE = ("", "0.0.0.0", "::", "*")
_LOCAL = re.compile(r"localhost$|127\.|::1$")


def warnings(config: RobotConfig) -> Iterator[Finding]:
    """Everything of that kind."""
    for check in _CHECKS:
        yield from check(config)


def implausible(where: str, key: str, value: float, unit: str) -> Iterator[Finding]:
    """Yield quantities that are likely in another unit."""
    largest, other, factor, offset = _LARGEST.get(unit, (math.inf, "", 1.0, 0.0))
    if largest < abs(value) < math.inf:
        slip = f"{value:g}{other} is {round(value * factor + offset, 4):g} {unit}"
        yield warning(where, key, f"{value:g} {unit} is more than an exoskeleton has: {slip}")


def _about_names(config: RobotConfig) -> Iterator[Finding]:
    refused = f"every desk refuses a robot with this name; at most {LONGEST_NAME} "
    if not is_robot_name(config.robot.name):
        yield warning("[robot]", "name", refused + ROBOT_SIGNS)
    for name in config.parameter:
        if not is_name(name):
            yield warning(header("parameter", name), "", refused + NAME_SIGNS)


def _about_host(config: RobotConfig) -> Iterator[Finding]:
    host = config.gateway.host
    if (host in _EVERYWHERE or not _LOCAL.match(host)) and not AccessFolder(config.access).has_keys:
        text = (
            f"{host!r} is open to other computers, and this robot has no keys yet: the gateway does not "
            f"start until `gwrms keys pair {config.path}` has let a desk in"
        )
        yield warning("[gateway]", "host", text)


def _about_socket(config: RobotConfig) -> Iterator[Finding]:
    if config.gateway.socket == "" and AccessFolder(config.access).has_keys:
        text = (
            "is empty, and this robot has keys: nobody on its own computer can stop it without a key; leave "
            "the key out, or name a socket"
        )
        yield warning("[gateway]", "socket", text)


def _about_controller(config: RobotConfig) -> Iterator[Finding]:
    commanded = config.gateway.role is Role.OBSERVER and config.joint
    if commanded and not config.stop.controller:
        text = (
            "a stop tells the drives only, whatever commands them keeps running: name that in "
            "[[stop.controller]], with component, object and the value that stops it"
        )
        yield warning("[stop]", "controller", text)


def _about_stop_times(config: RobotConfig) -> Iterator[Finding]:
    for name, joint in config.joint.items():
        if joint.stop_timeout_s > config.stop.timeout_s:
            text = (
                f"{joint.stop_timeout_s:g} is above [stop] timeout_s {config.stop.timeout_s:g}: a stop is "
                "answered before that, as not confirmed"
            )
            yield warning(header("joint", name), "stop_timeout_s", text)


def _about_buses(config: RobotConfig) -> Iterator[Finding]:
    for name, bus in config.can.items():
        where = header("can", name)
        if bus.bitrate is not None and bus.bitrate not in BITRATES:
            usual = ", ".join(map(str, BITRATES))
            yield warning(where, "bitrate", f"{bus.bitrate} is unusual; usual are {usual}")
        for key in ("sync_period_s", "heartbeat_s"):
            if config.gateway.role is Role.OBSERVER and getattr(bus, key) is not None:
                text = 'is not sent by an observer: who leads the bus is [gateway] role = "master"'
                yield warning(where, key, text)
        yield from _about_further_keys(where, bus)


def _about_further_keys(where: str, bus: CanSettings) -> Iterator[Finding]:
    """All of them go to python-can as they stand, also one of ours that is mistyped."""
    ours = [key for key in bus.__struct_fields__ if key != "more"]
    for key in bus.more:
        if hint := meant(key, ours, cutoff=0.85):
            yield warning(where, key, f"goes to {bus.interface} as it stands: {hint.rstrip()}")


def _about_joints(config: RobotConfig) -> Iterator[Finding]:
    for name, joint in config.joint.items():
        where = header("joint", name)
        for key, rated, unit in (
            ("rated_torque", joint.rated_torque, "N·m"),
            ("rated_current", joint.rated_current, "A"),
        ):
            if rated is not None:
                yield from implausible(where, key, rated, unit)


def _about_scaling(config: RobotConfig) -> Iterator[Finding]:
    """Off by magnitudes: angles would be, and no limit would hold."""
    for name, joint in config.joint.items():
        where, gear, counts = header("joint", name), joint.gear_ratio, joint.counts_per_revolution
        if gear < _GEARS[0]:
            text = f"{gear:g} would turn the joint faster than its motor: one that slows down is {1 / gear:g}"
            yield warning(where, "gear_ratio", text)
        elif gear > _GEARS[1]:
            text = (
                f"{gear:g} is more than a joint's gear has, 1 to {_GEARS[1]:g}: it is revolutions of the "
                "encoder per revolution of the joint, without the counts of the encoder"
            )
            yield warning(where, "gear_ratio", text)
        if not _COUNTS[0] <= counts <= _COUNTS[1]:
            text = (
                f"{counts:g} is no encoder's, usual are 1000 to 16777216: counts of 6064h a revolution, four "
                "times the lines of an incremental one"
            )
            yield warning(where, "counts_per_revolution", text)


def _about_control_loop(config: RobotConfig) -> Iterator[Finding]:
    loop = config.control_loop
    if loop is not None and loop.period_ms is not None and loop.tolerance_ms > loop.period_ms:
        text = (
            f"{loop.tolerance_ms:g} is above period_ms {loop.period_ms:g}: one that is missing would be no "
            f"overrun; half a period is {loop.period_ms / 2:g}"
        )
        yield warning("[control_loop]", "late_ms", text)


def _about_records(config: RobotConfig) -> Iterator[Finding]:
    if config.gateway.records is not None and not config.gateway.records.strip():
        folder = config.path.parent
        text = f"is empty: journal and held stop go into {folder}; name a folder, or leave the key out"
        yield warning("[gateway]", "records", text)


def _about_guarding(config: RobotConfig) -> Iterator[Finding]:
    for table, devices in (("joint", config.joint), ("device", config.device)):
        for name, device in devices.items():
            if config.gateway.role is Role.OBSERVER and device.guard_time_s is not None:
                text = 'is not done by an observer: who leads the bus is [gateway] role = "master"'
                yield warning(header(table, name), "guard_time_s", text)


def _about_serial_ports(config: RobotConfig) -> Iterator[Finding]:
    for where, one in config.on_ports():
        if one.baudrate not in BAUDRATES:
            usual = ", ".join(map(str, sorted(BAUDRATES)))
            yield warning(where, "baudrate", f"{one.baudrate} is unusual; usual are {usual}")
        if fnmatch.fnmatchcase(one.port, "/dev/tty[AU][CS][MB][0-9]*"):
            text = f"{one.port} may be another device next time: take its path in /dev/serial/by-id"
            yield warning(where, "port", text)
        if re.fullmatch(r"COM[0-9]+", one.port, re.IGNORECASE):
            text = f"{one.port!r} is a name of Windows: take its path in /dev/serial/by-id, see gwrms scan"
            yield warning(where, "port", text)
        elif one.port and "/" not in one.port:
            text = f"{one.port!r} is looked for where the gateway is started: write /dev/{one.port}"
            yield warning(where, "port", text)


def _about_feet(config: RobotConfig) -> Iterator[Finding]:
    for name, insole in config.insole.items():
        if insole.side(name) is None:
            text = 'its name does not begin with left or right: write foot = "left" or foot = "right"'
            yield warning(header("insole", name), "foot", text)


def _about_parameters(config: RobotConfig) -> Iterator[Finding]:
    for name, one in config.parameter.items():
        where = header("parameter", name)
        given = {key: value for key in ("min", "max") if (value := getattr(one, key)) is not None}
        if not given:
            yield warning(where, "min, max", "are not given: only its EDS limits it, where that does")
        for key, value in given.items():
            yield from implausible(where, key, value, one.unit)
        span = given["max"] - given["min"] if len(given) == 2 else math.inf
        if span == 0:
            yield warning(where, "min, max", f"are both {given['min']:g}: it could never be changed")
        if one.states == ():
            yield warning(where, "states", "names none: it could never be changed; leave the key out")
        if one.max_step is not None and 0 < span < one.max_step:
            text = f"{one.max_step:g} is more than from min to max, {span:g}: it limits nothing"
            yield warning(where, "max_step", text)


_CHECKS = (
    _about_names,
    _about_host,
    _about_socket,
    _about_controller,
    _about_stop_times,
    _about_buses,
    _about_joints,
    _about_scaling,
    _about_control_loop,
    _about_records,
    _about_guarding,
    _about_serial_ports,
    _about_feet,
    _about_parameters,
)
