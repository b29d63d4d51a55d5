"""The common contents of parameter files: their robot, device and values."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from msgspec import UNSET

from gateway.coding import Number
from gateway.streaming.sources import matches
from gateway.wire.component import ComponentInfo
from gateway.wire.parameter import ParameterInfo
from gateway.wire.robot import Description

COMMANDS = ("no number", "commanded", "controlword", "storage")  # as `ParameterInfo.read_only` calls them


class FileProblem(ValueError):
    """A file of parameters that cannot be used; the message names file, place and remedy."""


class WhichDevice(FileProblem):
    """A file is for one device, and nothing says for which."""


@dataclass(frozen=True, slots=True)
class Scope:
    """The robot that a file is made of or compared with; one device of it, where `--component` says so."""

    robot: Description
    component: str | None = None
    eds: Path | None = None  # what `--eds` names


@dataclass(frozen=True, slots=True)
class Saved:
    """Contents of a file: values by the robot's names, and remarks for a person."""

    values: Mapping[str, Number]
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Format:
    """One kind of file."""

    chosen: Callable[
        [Scope, Sequence[str]], list[ParameterInfo]
    ]  # what globs mean; without any, what it is for
    write: Callable[[Path, Scope, Mapping[str, Number]], bytes]
    read: Callable[[Path, Scope], Saved]


def is_configuration(info: ParameterInfo) -> bool:
    """Return whether it can be read and is no command, which the master writes while the robot moves."""
    return info.problem is None and info.read_only not in COMMANDS


def is_meant(info: ParameterInfo, globs: Sequence[str]) -> bool:
    """Return whether one of the names, addresses or globs means the parameter."""
    return matches(info.name, globs) or f"{info.component}.{info.object}" in globs


def device(component: ComponentInfo) -> Mapping[str, str | int]:
    """Return its EDS and its place; empty for a component that is no CANopen device."""
    return {} if component.device is UNSET else component.device
