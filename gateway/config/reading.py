"""TOML to the robot's structs, validated once; every error names file, table, key and remedy."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from drivers.bus.settings import CanSettings
from drivers.imu.settings import MountedSettings, kind_of
from drivers.insole.settings import InsoleSettings
from gateway.config.checks import complaints
from gateway.config.robot import (
    NAME,
    ControlLoopSettings,
    DeviceTable,
    GatewaySettings,
    JointTable,
    ParameterSettings,
    RobotConfig,
    RobotSettings,
    header,
)
from gateway.config.stop import StopSettings
from gateway.wording import key_of, plainly

Table = Mapping[str, Any]


class ConfigError(ValueError):
    """The robot's file cannot be used; the message names file, table, key and what is allowed."""


_SINGLE: Mapping[str, type[Struct]] = {
    "robot": RobotSettings,
    "gateway": GatewaySettings,
    "stop": StopSettings,
    "control_loop": ControlLoopSettings,
}
NAMED: Mapping[str, type[Struct]] = {
    "can": CanSettings,
    "joint": JointTable,
    "device": DeviceTable,
    "insole": InsoleSettings,
    "imu": MountedSettings,  # one of several, by what the table says
    "parameter": ParameterSettings,
}


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
        for complaint in complaints(config):
            raise ConfigError(complaint)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error
    return config


def _convert(path: Path, document: Table) -> RobotConfig:
    _check_keys("the file", document, allowed=[*_SINGLE, *NAMED, "guard"], required=["robot"])
    parts: dict[str, Any] = {"path": path}
    for table, kind in _SINGLE.items():
        if table in document:
            parts[table] = _struct(f"[{table}]", document[table], kind)
    for table, kind in NAMED.items():
        entries = document.get(table, {})
        if not isinstance(entries, dict):
            raise ConfigError(f"[{table}] holds tables: write [{table}.NAME]")
        parts[table] = {name: _struct(header(table, name), entry, kind) for name, entry in entries.items()}
    if "guard" in document:
        parts["guard"] = _guard(document["guard"])
    return RobotConfig(**parts)


def _guard(table: Any) -> Struct:
    """`[guard]` with its rules, each by what it watches."""
    from gateway.config.guard import GuardSettings  # here and below: for a file that has a guard only

    if not isinstance(table, dict) or not isinstance(table.get("rule", {}), dict):
        raise ConfigError("[guard] is a table, and so is each of its rules: write [guard.rule.NAME]")
    rules = {name: _rule(f"[guard.rule.{name}]", name, rule) for name, rule in table.get("rule", {}).items()}
    return msgspec.structs.replace(_struct("[guard]", {**table, "rule": {}}, GuardSettings), rule=rules)


def _rule(where: str, name: str, table: Any) -> Struct:
    from gateway.config.guard import WATCHES

    watch = table.get("watch") if isinstance(table, dict) else None
    if not isinstance(watch, str) or watch not in WATCHES:
        raise ConfigError(f"{where} watch: say what it watches, one of {', '.join(WATCHES)}")
    if not NAME.fullmatch(name):
        raise ConfigError(f"{where}: a name is a letter, then letters, digits, _ and -")
    return _struct(where, table, WATCHES[watch].rule)


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
