"""Parameters from an EDS: its writable numbers, by readable names, locked until released.

Its texts and other bytes are there to be read.
"""

import difflib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from eds import Description
from eds.datatypes import DATA_TYPES
from eds.naming import object_name, remark
from eds.report import pdo_rows
from gateway.coding import NUMBERS
from gateway.config.objects import AXIS_OFFSET, CONTROLWORD, RESTORE, STORE
from gateway.config.robot import DeviceTable, JointTable, Node, ParameterSettings, RobotConfig
from gateway.modules.control.parameters import READABLE, WRITABLE, Lock, Parameter, contradiction
from gateway.streaming.sources import matches

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

_PROFILE = range(0x6000, 0xA000)  # the objects of a device profile, AXIS_OFFSET for each axis
_COMMUNICATION = range(0x1000, 0x2000)
_COMMANDS = (  # CiA 402-2: what the master of a drive tells it while it moves
    0x6042,  # vl target velocity
    0x6060,  # modes of operation
    0x6071,  # target torque
    0x607A,  # target position
    0x60B0,  # position offset
    0x60B1,  # velocity offset
    0x60B2,  # torque offset
    0x60C1,  # interpolation data record
    0x60FE,  # digital outputs
    0x60FF,  # target velocity
)
_STOPPING = (  # CiA 402-2: what a drive does when it is stopped, or nobody speaks to it any more
    0x6007,  # abort connection option code
    0x605A,  # quick stop option code
    0x605B,  # shutdown option code
    0x605C,  # disable operation option code
    0x605D,  # halt option code
    0x605E,  # fault reaction option code
    0x6085,  # quick stop deceleration
)


def offered(
    config: RobotConfig, descriptions: Mapping[str, Description], own: Iterable[Parameter]
) -> Iterator[Parameter]:
    """Yield the parameters of every table that says `parameters = "eds"`, without the file's `own`."""
    taken = {(config.node_of(one.component), one.index, one.subindex): one.name for one in own}
    shared: set[Node] = set()  # those whose common objects have their names already
    for kind, tables in (("joint", config.joint), ("device", config.device)):
        for component, table in tables.items():
            if table.parameters is None or component not in descriptions:
                continue
            node = config.node_of(component)
            offer = _Offer(f"[{kind}.{component}]", component, table, descriptions[component], taken)
            yield from offer.parameters(common=node not in shared)
            shared.add(node)


class _Offer:
    """One table's; `taken` are the objects that the robot's file names itself."""

    def __init__(
        self,
        where: str,
        component: str,
        table: JointTable | DeviceTable,
        description: Description,
        taken: Mapping[tuple[Node, int, int], str],
    ) -> None:
        self._where = where
        self._component = component
        self._table = table
        self._description = description
        self._taken = taken
        self._node: Node = (table.bus, table.node_id)
        self._store = description.has(STORE, 1)
        self._mapped = {
            entry[:2]
            for pdo in pdo_rows(description)
            for entry in pdo.mapped
            if pdo.enabled is not False and pdo.name.startswith("RPDO")
        }

    def parameters(self, *, common: bool) -> Iterator[Parameter]:
        """Yield those of its own axis, and those that all axes of the node share where `common` says so."""
        variables = [one for one in self._description.variables() if self._is_offered(one, common=common)]
        names = self._names(variables)
        for variable, name in zip(variables, names, strict=True):
            yield self._parameter(variable, name)
        yield from self._unmatched(variables, names)

    def _is_offered(self, variable: "ODVariable", *, common: bool) -> bool:
        data_type = DATA_TYPES.get(variable.data_type or 0)
        return (
            data_type is not None
            and variable.access_type.lower() in (WRITABLE if data_type.kind in NUMBERS else READABLE)
            and (self._node, variable.index, variable.subindex) not in self._taken
            and self._is_ours(variable.index, common=common)
        )

    def _is_ours(self, index: int, *, common: bool) -> bool:
        if isinstance(self._table, DeviceTable):
            return True
        return common if index not in _PROFILE else _axis(index) == self._table.axis

    def _names(self, variables: list["ODVariable"]) -> list[str]:
        """Each object's name in the EDS; with its address, where that is no name or that of another."""
        names = [object_name(one) for one in variables]
        used = Counter(names)
        used.update(one.partition(".")[2] for one in self._taken.values() if self._is_own(one))
        return [
            name if name and used[name] == 1 else f"{name or 'object'}_{one.index:04x}:{one.subindex}"
            for one, name in zip(variables, names, strict=True)
        ]

    def _is_own(self, name: str) -> bool:
        return name.partition(".")[0] == self._component

    def _parameter(self, variable: "ODVariable", name: str) -> Parameter:
        address = _address(variable)
        numeric = _is_number(variable)
        low, high = (variable.min, variable.max) if numeric else (None, None)
        return Parameter(
            f"{self._component}.{name}",
            self._component,
            ParameterSettings(object=address, unit=remark(variable.name)),
            variable.index,
            variable.subindex,
            variable.data_type or 0,
            variable.access_type.lower(),
            low,
            high,
            self._store,
            contradiction(low, high, self._description.path.name),
            lock=self._lock(variable, name, address) if numeric else Lock.TEXT,
            table=self._where,
            default=variable.default if numeric else None,
        )

    def _lock(self, variable: "ODVariable", name: str, address: str) -> Lock | None:
        release = self._table.release
        lock = own_lock(variable.index, is_led=(variable.index, variable.subindex) in self._mapped)
        if lock in (Lock.CONTROLWORD, Lock.STORAGE, Lock.COMMUNICATION):
            return lock
        if name in release or address in release:
            return None
        return lock or (None if matches(name, release) else Lock.UNRELEASED)

    def _unmatched(self, variables: list["ODVariable"], names: list[str]) -> Iterator[Parameter]:
        """Yield released names that do not exist, so that they are visible among the parameters."""
        addresses = {_address(one) for one in variables}
        known = {*names, *(one.partition(".")[2] for one in self._taken.values() if self._is_own(one))}
        for entry in self._table.release:
            if entry not in addresses and not any(matches(name, [entry]) for name in known):
                close = difflib.get_close_matches(entry, known, n=1)
                hint = f"; did you mean {close[0]!r}?" if close else ""
                problem = (
                    f"{self._where} release: {self._description.path.name} has no writable number "
                    f"{entry!r}{hint}"
                )
                settings = ParameterSettings(object="0x0000:0")
                yield Parameter(
                    f"{self._component}.{entry}", self._component, settings, 0, 0, problem=problem
                )


def own_lock(index: int, *, is_led: bool) -> Lock | None:
    """Return the lock of an object by its nature, independent of any description.

    `is_led`: an RPDO of the EDS brings it.
    """
    index = _of_first_axis(index)
    if index == CONTROLWORD:
        return Lock.CONTROLWORD
    if index in _COMMUNICATION:
        return Lock.STORAGE if index in (STORE, RESTORE) else Lock.COMMUNICATION
    if index in _COMMANDS or is_led:
        return Lock.COMMANDED
    return Lock.STOPPING if index in _STOPPING else None


def _is_number(variable: "ODVariable") -> bool:
    return DATA_TYPES[variable.data_type or 0].kind in NUMBERS


def _address(variable: "ODVariable") -> str:
    return f"0x{variable.index:04X}:{variable.subindex}"


def _axis(index: int) -> int:
    return (index - _PROFILE.start) // AXIS_OFFSET


def _of_first_axis(index: int) -> int:
    return index - AXIS_OFFSET * _axis(index) if index in _PROFILE else index
