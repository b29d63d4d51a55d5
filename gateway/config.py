"""The robot's file: TOML to frozen structs, validated once; every error names file, table, key and remedy."""

import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct

from drivers.bus.settings import CanSettings, DeviceSettings, Role
from drivers.component import Kind
from drivers.imu.settings import CanImuSettings, ImuSettings, MountedSettings, NodeImuSettings, kind_of
from drivers.insole.settings import InsoleSettings
from drivers.joint.cia402 import STATE_WORDS
from drivers.joint.settings import JointSettings
from gateway.guard.checks import complaints as about_guard
from gateway.guard.settings import WATCHES, GuardSettings
from gateway.modules.stop.settings import StopSettings
from gateway.modules.stop.settings import complaints as about_stop
from gateway.object_names import ObjectName, address_of
from gateway.records.folder import default_folder
from gateway.sdo_ids import complaints as about_sdo
from gateway.wording import key_of, plainly

Table = Mapping[str, Any]
Node = tuple[str, int]  # a bus by its name, and a node id there
OnBus = JointSettings | DeviceSettings | CanImuSettings | NodeImuSettings

CONTROLWORD = 0x6040
AXIS_OFFSET = 0x800  # between the objects of a multi-axis drive's axes (CiA 402-2)
STORE, RESTORE = 0x1010, 0x1011
RESERVED_NAMES = ("resource", "status", "robot", "guard")
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


class ConfigError(ValueError):
    """The robot's file cannot be used; the message names file, table, key and what is allowed."""


class RobotSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[robot]`."""

    name: Annotated[str, Meta(min_length=1)]


class GatewaySettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[gateway]`: where it listens (port 0 picks one) and how long modules stay after the last client.

    `records` is the folder of journal, held stop and pending reverts, relative to the robot's file.
    `classic_port` serves the process list as the paper's daemon does, for comparison.
    Beyond `max_cpu_percent` of a core, streams send fewer rows. For a client that is slow, `buffer_kb` of its
    streams wait; one that takes nothing for `stuck_s` is dropped.
    """

    host: str = "127.0.0.1"
    port: Annotated[int, Meta(ge=0, le=65535)] = 7420
    role: Role = Role.OBSERVER
    linger_s: Annotated[float, Meta(ge=0, le=86_400)] = 5.0
    records: str | None = None
    classic_port: Annotated[int, Meta(ge=0, le=65535)] | None = None
    max_cpu_percent: Annotated[float, Meta(gt=0)] | None = None
    buffer_kb: Annotated[int, Meta(ge=64, le=65_536)] = 1024
    stuck_s: Annotated[float, Meta(gt=0, le=3600)] = 30.0


class ControlLoopSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[control_loop]`: the robot's own control program, on this computer.

    `processes` are names, or globs of them, as `ps` shows them, or of the programs that they run. Where `bus`
    is given, it puts a frame with `can_id` there each `period_ms`; one that comes more than `late_ms` after
    its time (half a period) is an overrun.
    """

    processes: Annotated[tuple[str, ...], Meta(min_length=1)]
    bus: str | None = None
    can_id: Annotated[int, Meta(ge=0, le=0x1FFF_FFFF)] = 0x080
    period_ms: Annotated[float, Meta(gt=0, le=10_000)] | None = None
    late_ms: Annotated[float, Meta(gt=0)] | None = None

    @property
    def tolerance_ms(self) -> float:
        """After a frame's time."""
        return (self.period_ms or 0.0) / 2 if self.late_ms is None else self.late_ms


class JointTable(JointSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[joint.NAME]`: a joint, and what its EDS offers as parameters."""

    parameters: Literal["eds"] | None = None  # every writable number of the EDS, to be read
    release: tuple[str, ...] = ()  # names or globs of those that may be changed too


class DeviceTable(DeviceSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[device.NAME]`: another device, and what its EDS offers as parameters."""

    parameters: Literal["eds"] | None = None
    release: tuple[str, ...] = ()


class ParameterSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[parameter."component.name"]`: one object of a CANopen device that may be changed, and how far.

    value = device's number · scale, in `unit`. `max_step` limits one change. `live` allows changes while a
    drive is enabled. `states` are the CiA 402 states that allow a change.
    """

    object: ObjectName
    unit: str = ""
    scale: float = 1.0
    min: float | None = None
    max: float | None = None
    max_step: Annotated[float, Meta(gt=0)] | None = None
    live: bool = False
    states: tuple[str, ...] | None = None

    @property
    def address(self) -> tuple[int, int]:
        """Index and subindex."""
        return address_of(self.object)


class RobotConfig(Struct, frozen=True, kw_only=True):
    """A robot as its file describes it; each dictionary is by the components' names."""

    path: Path
    robot: RobotSettings
    gateway: GatewaySettings = GatewaySettings()
    can: dict[str, CanSettings] = {}
    joint: dict[str, JointTable] = {}
    device: dict[str, DeviceTable] = {}
    insole: dict[str, InsoleSettings] = {}
    imu: dict[str, MountedSettings] = {}
    parameter: dict[str, ParameterSettings] = {}
    stop: StopSettings = StopSettings()
    guard: GuardSettings | None = None
    control_loop: ControlLoopSettings | None = None

    def node_of(self, component: str) -> Node:
        """Where a joint or device is: bus and node id."""
        table = self.joint[component] if component in self.joint else self.device[component]
        return table.bus, table.node_id

    def sharing(self, component: str) -> tuple[str, ...]:
        """The joints and devices on one's node, itself among them: the axes of one drive."""
        node = self.node_of(component)
        return tuple(name for name in (*self.joint, *self.device) if self.node_of(name) == node)

    def drives_of(self, component: str) -> tuple[str, ...]:
        """The joints that its parameters may move: those on its node; where it has none, every joint."""
        return tuple(name for name in self.sharing(component) if name in self.joint) or tuple(self.joint)

    def on_buses(self) -> Iterator[tuple[str, OnBus]]:
        """Every table of something on a CAN bus, with its header."""
        for table in COMPONENT_TABLES:
            for name, settings in getattr(self, table).items():
                if isinstance(settings, OnBus):
                    yield f"[{table}.{name}]", settings

    @property
    def records(self) -> Path:
        """The folder of this robot's records."""
        given = self.gateway.records
        return default_folder(self.robot.name) if given is None else self.path.parent / given


_SINGLE: Mapping[str, type[Struct]] = {
    "robot": RobotSettings,
    "gateway": GatewaySettings,
    "stop": StopSettings,
    "control_loop": ControlLoopSettings,
}
_NAMED: Mapping[str, type[Struct]] = {
    "can": CanSettings,
    "joint": JointTable,
    "device": DeviceTable,
    "insole": InsoleSettings,
    "imu": MountedSettings,  # one of several, by what the table says
    "parameter": ParameterSettings,
}
COMPONENT_TABLES = tuple(Kind)  # each kind by its name


def load(path: Path) -> RobotConfig:
    """Read and check the robot's file.

    Raises:
        ConfigError: it is not there, is no TOML, or says something that cannot work.

    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}; name the robot's file") from error
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: is no TOML: {error}") from error
    try:
        config = _convert(path, document)
        for complaint in _complaints(config):
            raise ConfigError(complaint)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error
    return config


def _convert(path: Path, document: Table) -> RobotConfig:
    _check_keys("the file", document, allowed=[*_SINGLE, *_NAMED, "guard"], required=["robot"])
    parts: dict[str, Any] = {"path": path}
    for table, kind in _SINGLE.items():
        if table in document:
            parts[table] = _struct(f"[{table}]", document[table], kind)
    for table, kind in _NAMED.items():
        entries = document.get(table, {})
        if not isinstance(entries, dict):
            raise ConfigError(f"[{table}] holds tables: write [{table}.NAME]")
        parts[table] = {name: _struct(_header(table, name), entry, kind) for name, entry in entries.items()}
    if "guard" in document:
        parts["guard"] = _guard(document["guard"])
    return RobotConfig(**parts)


def _guard(table: Any) -> Struct:
    """`[guard]` with its rules, each by what it watches."""
    if not isinstance(table, dict) or not isinstance(table.get("rule", {}), dict):
        raise ConfigError("[guard] is a table, and so is each of its rules: write [guard.rule.NAME]")
    rules = {name: _rule(f"[guard.rule.{name}]", name, rule) for name, rule in table.get("rule", {}).items()}
    return msgspec.structs.replace(_struct("[guard]", {**table, "rule": {}}, GuardSettings), rule=rules)


def _rule(where: str, name: str, table: Any) -> Struct:
    watch = table.get("watch") if isinstance(table, dict) else None
    if not isinstance(watch, str) or watch not in WATCHES:
        raise ConfigError(f"{where} watch: say what it watches, one of {', '.join(WATCHES)}")
    if not _NAME.fullmatch(name):
        raise ConfigError(f"{where}: a name is a letter, then letters, digits, _ and -")
    return _struct(where, table, WATCHES[watch].rule)


def _header(table: str, name: str) -> str:
    return f'[{table}."{name}"]' if "." in name else f"[{table}.{name}]"


def _struct(where: str, table: Any, kind: type[Struct]) -> Struct:
    if not isinstance(table, dict):
        raise ConfigError(f"{where} is a table, not {table!r}")
    if kind is ParameterSettings and table and all(isinstance(entry, dict) for entry in table.values()):
        component, name = where.removesuffix("]").rpartition(".")[2], next(iter(table))
        raise ConfigError(f'{where}: a parameter\'s name is one key: write [parameter."{component}.{name}"]')
    if kind is MountedSettings:
        kind = kind_of(table)
    fields = msgspec.structs.fields(kind)
    required = [field.encode_name for field in fields if field.required]
    # Whatever else stands in [can.NAME] is for python-can.
    allowed = None if kind is CanSettings else [field.encode_name for field in fields]
    _check_keys(where, table, allowed, required)
    try:
        if issubclass(kind, CanSettings):
            return kind.from_table(table)
        return msgspec.convert(table, kind)
    except msgspec.ValidationError as error:
        place = where if key_of(error) else f"{where}:"
        raise ConfigError(f"{place} {plainly(error)}") from error


def _check_keys(where: str, table: Table, allowed: list[str] | None, required: list[str]) -> None:
    for key in table:
        if allowed is not None and key not in allowed:
            import difflib  # for who has mistyped only

            close = difflib.get_close_matches(key, allowed, n=1)
            hint = f"did you mean {close[0]!r}? " if close else ""
            raise ConfigError(f"{where} has an unknown key {key!r}: {hint}allowed are {', '.join(allowed)}")
    missing = [key for key in required if key not in table]
    if missing:
        raise ConfigError(f"{where} lacks the key {', '.join(map(repr, missing))}")


def _complaints(config: RobotConfig) -> Iterator[str]:
    yield from _about_names(config)
    yield from _about_nodes(config)
    yield from about_sdo(config)
    yield from _about_ports(config)
    for table, devices in (("joint", config.joint), ("device", config.device)):
        for name, device in devices.items():
            yield from _about_release(_header(table, name), name, device)
    for name, parameter in config.parameter.items():
        yield from _about_parameter(config, name, parameter)
    yield from _about_same_objects(config)
    yield from about_stop(config, config.stop)
    if config.control_loop is not None:
        yield from _about_control_loop(config, config.control_loop)
    if config.guard is not None:
        yield from about_guard(config, config.guard)


def _about_names(config: RobotConfig) -> Iterator[str]:
    seen: dict[str, str] = {}
    for table in COMPONENT_TABLES:
        for name in getattr(config, table):
            if not _NAME.fullmatch(name):
                yield f"{_header(table, name)}: a name is a letter, then letters, digits, _ and -"
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
        where = _header("parameter", name)
        node = config.node_of(name.partition(".")[0])
        other = seen.setdefault((node, parameter.address), where)
        if other != where:
            yield (
                f"{where} object: {parameter.object} of node {node[1]} on bus {node[0]!r} is {other} "
                "already; keep one of the two tables"
            )


def _about_parameter(config: RobotConfig, name: str, parameter: ParameterSettings) -> Iterator[str]:
    where = _header("parameter", name)
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
