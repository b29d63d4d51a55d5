"""TOML to the robot's structs, validated once; every error names file, table, key and remedy."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from drivers.bus.settings import CanSettings, ChannelSettings
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
from gateway.tables.decoding import Decoding
from gateway.tables.finding import Finding, in_order, lines, mistakes, unknown
from gateway.tables.reading import Unreadable, content, parse
from gateway.tables.reading import read as read_tables

Table = Mapping[str, Any]


class ConfigError(ValueError):
    """The robot's file cannot be used; the message names file, table, key what is allowed, a line each."""


SINGLE: Mapping[str, type[Struct]] = {
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
    "channel": ChannelSettings,
}
TABLES = (*SINGLE, *NAMED, "guard")


@dataclass(frozen=True, slots=True)
class Examined:
    """A robot's file with everything that is wrong with it, or likely is; `config` where it can be served."""

    config: RobotConfig | None
    findings: list[Finding] = field(default_factory=list)
    rest: RobotConfig | None = None  # of one that cannot be served: what can be read of it, mistakes and all


def load(path: Path) -> RobotConfig:
    """Read and check the robot's file.

    Raises:
        ConfigError: it is not there, is no TOML, or says something that cannot work.

    """
    return load_bytes(path, read(path))[0]


def read(path: Path) -> bytes:
    """Return what stands in the file; raises `ConfigError`."""
    try:
        return content(path)
    except Unreadable as error:
        raise ConfigError(lines(path, [error.finding])) from error


def load_bytes(path: Path, data: bytes) -> tuple[RobotConfig, list[Finding]]:
    """Return the robot of what stands in the file, or stood there, and what is likely wrong with it.

    Raises:
        ConfigError: it is no TOML, or says something that cannot work.

    """
    try:
        found = examined(path, parse(data))
    except Unreadable as error:
        raise ConfigError(lines(path, [error.finding])) from error
    if found.config is None:
        raise ConfigError(lines(path, mistakes(found.findings)))
    return found.config, found.findings


def examine(path: Path) -> Examined:
    """Read the robot's file; whatever is wrong with it is told, not only the first thing."""
    try:
        document = read_tables(path)
    except Unreadable as error:
        return Examined(None, [error.finding])
    return examined(path, document)


def examined(path: Path, document: Table) -> Examined:
    """Return the same for what stands in it."""
    decoding = Decoding()
    config = _Reading(decoding).config(path, document)
    findings = decoding.findings
    if config is not None:
        findings.extend(complaints(config))
    is_wrong = bool(mistakes(findings))
    return Examined(None if is_wrong else config, in_order(findings, document), config if is_wrong else None)


class _Reading:
    """One file's tables; those that cannot be read are named in `lost`, because others speak of them."""

    def __init__(self, decoding: Decoding) -> None:
        self._decoding = decoding
        self._lost: dict[str, frozenset[str]] = {}

    def config(self, path: Path, document: Table) -> RobotConfig | None:
        """Return the valid parts of the file; `None` if it describes no robot at all."""
        self._decoding.tables(document, TABLES)
        if "robot" not in document:
            self._decoding.complain("[robot]", "", 'is missing: write [robot] and below it name = "…"')
        parts: dict[str, Any] = {
            "robot": RobotSettings(name="unnamed")
        }  # so that the rest is told all the same
        for table, kind in SINGLE.items():
            made = self._struct(f"[{table}]", document[table], kind) if table in document else None
            parts |= {} if made is None else {table: made}
        parts |= {table: self._named(table, kind, document.get(table, {})) for table, kind in NAMED.items()}
        if "guard" in document:
            parts["guard"] = self._guard(document["guard"])
        return RobotConfig(path=path, lost=self._lost, digest=_digest(document), **parts)

    def _named(self, table: str, kind: type[Struct], entries: Any) -> dict[str, Struct]:
        there = (
            {name: one for name, one in entries.items() if _is_table(one)}
            if isinstance(entries, dict)
            else {}
        )
        if not isinstance(entries, dict) or len(there) < len(entries):
            self._decoding.complain(
                f"[{table}]", "", f"holds tables, each with its name: write [{table}.NAME]"
            )
        made = {name: self._struct(header(table, name), entry, kind) for name, entry in there.items()}
        self._lost[table] = frozenset(name for name, one in made.items() if one is None)
        return {name: one for name, one in made.items() if one is not None}

    def _struct(self, where: str, table: Any, kind: type[Struct]) -> Struct | None:
        if not isinstance(table, dict):
            return self._decoding.struct(where, table, kind)
        if kind in (ParameterSettings, ChannelSettings) and table and all(map(_is_table, table.values())):
            what, _, component = where.strip("[]").partition(".")
            text = f'a {what}\'s name is one key: write [{what}."{component}.{next(iter(table))}"]'
            self._decoding.complain(where, "", text)
            return None
        if kind is CanSettings:
            table = CanSettings.parted(table)
        return self._decoding.struct(where, table, kind_of(table) if kind is MountedSettings else kind)

    def _guard(self, table: Any) -> Struct | None:
        """`[guard]` with its rules, each by what it watches."""
        from gateway.config.guard import GuardSettings  # here and below: for a file that has a guard only

        rules = table.get("rule", {}) if isinstance(table, dict) else None
        if not isinstance(rules, dict):
            text = "is a table, and so is each of its rules: write [guard.rule.NAME]"
            self._decoding.complain("[guard]", "", text)
            return None
        guard = self._decoding.struct("[guard]", {**table, "rule": {}}, GuardSettings)
        made = {name: self._rule(f"[guard.rule.{name}]", name, rule) for name, rule in rules.items()}
        good = {name: rule for name, rule in made.items() if rule is not None}
        self._lost["guard"] = frozenset(made.keys() - good.keys())
        return None if guard is None else msgspec.structs.replace(guard, rule=good)

    def _rule(self, where: str, name: str, table: Any) -> Struct | None:
        from gateway.config.guard import WATCHES

        if not isinstance(table, dict):
            return self._decoding.struct(where, table, Struct)
        if not NAME.fullmatch(name):
            self._decoding.complain(where, "", "a name is a letter, then letters, digits, _ and -")
        watch = table.get("watch")
        if not isinstance(watch, str) or watch not in WATCHES:
            missing = f"is missing; allowed are {', '.join(WATCHES)}"
            self._decoding.complain(where, "watch", unknown(watch, WATCHES) if watch else missing)
            return None
        return self._decoding.struct(where, table, WATCHES[watch].rule)


def _digest(document: Table) -> str:
    said = json.dumps(document, sort_keys=True, default=str)
    return hashlib.sha256(said.encode("utf-8", "surrogatepass")).hexdigest()


def _is_table(entry: Any) -> bool:
    return isinstance(entry, dict | list)  # a list is complained about where it is read
