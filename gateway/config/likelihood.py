"""What can work in a robot's file and is likely not what was meant: warnings, each with what likely was."""

import fnmatch
import math
import re
from collections.abc import Iterator, Mapping

from drivers.bus.settings import CanSettings, Role
from gateway.access.folder import AccessFolder
from gateway.config.robot import RobotConfig, header
from gateway.plain import LONGEST_NAME, NAME_SIGNS, ROBOT_SIGNS, is_name, is_robot_name
from gateway.tables.finding import Finding, meant, warning

BITRATES = (10_000, 20_000, 50_000, 83_333, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
BAUDRATES = frozenset(
    {1200, 2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200, 230_400, 250_000, 460_800, 500_000, 921_600}
    | {1_000_000, 1_500_000, 2_000_000, 3_000_000, 4_000_000}
)
# By unit: more than that is no quantity of an exoskeleton, and which one it likely is.
_LARGEST: Mapping[str, tuple[float, str, float]] = {
    "rad": (6.2832, "°", math.pi / 180.0),
    "m": (5.0, " mm", 1e-3),
    "s": (600.0, " ms", 1e-3),
    "rad/s": (100.0, "°/s", math.pi / 180.0),
}
_EVERYWHERE = ("", "0.0.0.0", "::", "*")
_LOCAL = re.compile(r"localhost$|127\.|::1$")


def warnings(config: RobotConfig) -> Iterator[Finding]:
    """Everything of that kind."""
    for check in _CHECKS:
        yield from check(config)


def implausible(where: str, key: str, value: float, unit: str) -> Iterator[Finding]:
    """Where a quantity is likely in another unit."""
    largest, other, factor = _LARGEST.get(unit, (math.inf, "", 1.0))
    if largest < abs(value) < math.inf:
        slip = f"{value:g}{other} is {round(value * factor, 4):g} {unit}"
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
            f"{host!r} is open to other computers, and this robot has no keys yet: until `gwrms keys pair "
            f"{config.path}` has made them, it is not served there"
        )
        yield warning("[gateway]", "host", text)


def _about_controller(config: RobotConfig) -> Iterator[Finding]:
    commanded = config.gateway.role is Role.OBSERVER and config.joint
    if commanded and not config.stop.controller:
        text = (
            "a stop tells the drives only, and what commands them goes on: name that in [[stop.controller]], "
            "with component, object and the value that stops it"
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


def _about_serial_ports(config: RobotConfig) -> Iterator[Finding]:
    for where, one in config.on_ports():
        if one.baudrate not in BAUDRATES:
            usual = ", ".join(map(str, sorted(BAUDRATES)))
            yield warning(where, "baudrate", f"{one.baudrate} is unusual; usual are {usual}")
        if fnmatch.fnmatchcase(one.port, "/dev/tty[AU][CS][MB][0-9]*"):
            text = f"{one.port} may be another device next time: take its path in /dev/serial/by-id"
            yield warning(where, "port", text)
        if "/" not in one.port:
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
        if one.max_step is not None and 0 < span < one.max_step:
            text = f"{one.max_step:g} is more than from min to max, {span:g}: it limits nothing"
            yield warning(where, "max_step", text)


_CHECKS = (
    _about_names,
    _about_host,
    _about_controller,
    _about_stop_times,
    _about_buses,
    _about_serial_ports,
    _about_feet,
    _about_parameters,
)
