"""Reasons why an object cannot be written, and the lines of the robot's file that would allow it."""

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import TYPE_CHECKING

from eds.datatypes import DATA_TYPES
from eds.naming import object_name
from gateway.coding import NUMBERS
from gateway.config.robot import DeviceTable, JointTable
from gateway.modules.control.eds_parameters import own_lock
from gateway.modules.control.parameters import WRITABLE, Lock, Parameter

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

_BY_NAME = (Lock.UNRELEASED, Lock.COMMANDED, Lock.STOPPING)  # what `release` reaches
_NOBODY_SAID = "it is no parameter: the robot's file does not say that it may be changed, nor how far"


@dataclass(frozen=True, slots=True)
class WriteRefusal:
    """In full words; `lines` are to be added to the robot's file, `None` where none would help."""

    why: str
    lines: str | None = None


@dataclass(frozen=True, slots=True)
class Table:
    """Table of a component in the robot's file: its header and settings."""

    component: str
    header: str
    settings: JointTable | DeviceTable


def locked(
    variable: "ODVariable",
    parameter: Parameter | None,
    table: Table,
    taken: AbstractSet[str],
    pdos: Sequence[str],
) -> WriteRefusal | None:
    """`None` where it can be written as the parameter that it is.

    `taken` are the names there are, `pdos` those that it is mapped in.
    """
    access = variable.access_type.lower()
    if access not in WRITABLE:
        return WriteRefusal(f"the device lets nobody write it and read it back: its EDS says {access}")
    if parameter is None:
        return _no_parameter(variable, table, taken, pdos)
    if parameter.problem is not None:
        return WriteRefusal(parameter.problem)
    if parameter.lock is None:
        return None
    why = parameter.remedy(parameter.lock)
    if parameter.lock in _BY_NAME:
        return WriteRefusal(why, _released(table, parameter))
    if parameter.lock is Lock.COMMUNICATION:
        return WriteRefusal(why, _own_table(variable, table, taken - {parameter.name}))
    return WriteRefusal(why)


def _no_parameter(
    variable: "ODVariable", table: Table, taken: AbstractSet[str], pdos: Sequence[str]
) -> WriteRefusal:
    known = DATA_TYPES.get(variable.data_type or 0)
    if known is None or known.kind not in NUMBERS:
        return WriteRefusal(Lock.TEXT.remedy)
    lock = own_lock(variable.index, is_led=any(name.startswith("RPDO") for name in pdos))
    if lock in (Lock.CONTROLWORD, Lock.STORAGE):
        return WriteRefusal(lock.remedy)
    beware = "" if lock is None else f"; beware: {lock.remedy.partition(';')[0]}"
    return WriteRefusal(f"{_NOBODY_SAID}{beware}", _own_table(variable, table, taken))


def _released(table: Table, parameter: Parameter) -> str:
    """Return its whole name beside what is released already: what a glob does not reach is reached so."""
    names = [*table.settings.release, parameter.name.partition(".")[2]]
    return f"{table.header}\nrelease = [{', '.join(_quoted(name) for name in names)}]"


def _own_table(variable: "ODVariable", table: Table, taken: AbstractSet[str]) -> str:
    where = f"0x{variable.index:04X}:{variable.subindex}"
    own = object_name(variable) or "object"
    name = f"{table.component}.{own}"
    if name in taken:
        name = f"{name}_{variable.index:04x}_{variable.subindex}"
    return f'[parameter.{_quoted(name)}]\nobject = "{where}"'


def _quoted(text: str) -> str:
    """Return it as a basic string of TOML."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
