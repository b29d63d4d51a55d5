"""Any object of a device that has an EDS: found by address or name, and read; writing is for parameters."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from drivers.errors import DeviceTimeout, DriverError
from eds import Description
from eds.datatypes import DATA_TYPES, DOMAIN
from eds.naming import remark
from eds.report import pdo_rows
from gateway.config.robot import RobotConfig
from gateway.connections.fair_queue import Client
from gateway.modules.component.module import ComponentModule
from gateway.modules.control.parameters import READABLE, WRITABLE, Parameter
from gateway.modules.control.unanswered import Unanswered
from gateway.modules.control.write_refusals import Table, locked
from gateway.process.futures import back, done, gather, then
from gateway.process.loop import Loop
from gateway.wire.dictionary import (
    ObjectInfo,
    ObjectList,
    ObjectListParams,
    ObjectReadParams,
    ObjectValue,
    ObjectValues,
)
from gateway.wire.framing import ErrorKind, refuse
from gateway.wire.limits import OBJECTS_LISTED
from gateway.wire.object_search import fitting

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable


@dataclass(frozen=True, slots=True)
class Wanted:
    """One object that somebody wants to read."""

    component: str
    index: int
    subindex: int

    @property
    def name(self) -> str:
        return address(self.index, self.subindex)


class Objects:
    """Every object of a robot's devices. It belongs to the loop's thread."""

    def __init__(
        self,
        config: RobotConfig,
        component: ComponentModule,
        loop: Loop,
        parameters: Mapping[str, Parameter],
        silence: Callable[[str], str | None],
        unanswered: Unanswered,
        ask: "Callable[[Client, Sequence[Wanted]], Future[dict[str, ObjectValue]]]",
    ) -> None:
        """`ask` has objects read in their turn, by `read_all`."""
        self._tables = {
            name: Table(name, f"[{kind}.{name}]", settings)
            for kind, tables in (("joint", config.joint), ("device", config.device))
            for name, settings in tables.items()
        }
        self._config = config
        self._component = component
        self._loop = loop
        self._silence = silence
        self._unanswered = unanswered
        self._names = frozenset(parameters)
        # By node: what all axes of one share, and what is another axis's, is a parameter all the same.
        self._parameters = {
            (config.node_of(one.component), one.object): one
            for one in parameters.values()
            if one.component in self._tables
        }
        self._mapped: dict[str, dict[tuple[int, int], list[str]]] = {}  # by component, once it was asked for
        self._ask = ask

    def listed(self, params: ObjectListParams) -> ObjectList:
        """Return the matching objects of the EDS.

        Raises:
            RpcError: there is no such component, or it has no object dictionary.

        """
        description, fits = self._description(params.component), fitting(params.search)
        found = [
            variable
            for variable in description.variables()
            if fits(variable.index, variable.subindex, variable.qualname)
        ]
        mapped = self._mapped_in(params.component, description)
        shown = [self._info(params.component, variable, mapped) for variable in found[:OBJECTS_LISTED]]
        return ObjectList(params.component, shown, len(found) - len(shown))

    def read(self, params: ObjectReadParams, client: Client) -> "Future[ObjectValues]":
        """Return the device's present values of objects; raises `RpcError` for one that its EDS lacks."""
        description = self._description(params.component)
        wanted = [self._wanted(params.component, text, description) for text in dict.fromkeys(params.objects)]
        ready = self._component.when_ready({params.component})
        values = then(ready, lambda _none: self._ask(client, wanted))
        return then(values, partial(ObjectValues, params.component))

    # -- what the EDS says -----------------------------------------------------------------------------------

    def _description(self, component: str) -> Description:
        descriptions = self._component.robot.descriptions
        if component in self._tables and component in descriptions:
            return descriptions[component]
        if component in self._component.absent:
            raise refuse(ErrorKind.UNAVAILABLE, f"{component}: {self._component.absent[component]}")
        known = ", ".join(one for one in descriptions if one in self._tables) or "none"
        raise refuse(
            ErrorKind.UNKNOWN_NAME, f"{component!r} has no object dictionary; those that have: {known}"
        )

    def _wanted(self, component: str, text: str, description: Description) -> Wanted:
        index, _, subindex = text.partition(":")
        wanted = Wanted(component, int(index, 16), int(subindex))
        if not description.has(wanted.index, wanted.subindex):
            raise refuse(ErrorKind.UNKNOWN_NAME, f"{description.path.name} has no object {wanted.name}")
        return wanted

    def _mapped_in(self, component: str, description: Description) -> Mapping[tuple[int, int], list[str]]:
        """Return the PDOs that each object is mapped in."""
        if component not in self._mapped:
            found: dict[tuple[int, int], list[str]] = {}
            for pdo in pdo_rows(description):
                for index, subindex, _bits in pdo.mapped if pdo.enabled is not False else ():
                    found.setdefault((index, subindex), []).append(pdo.name)
            self._mapped[component] = found
        return self._mapped[component]

    def _info(
        self, component: str, variable: "ODVariable", mapped: Mapping[tuple[int, int], list[str]]
    ) -> ObjectInfo:
        where = address(variable.index, variable.subindex)
        parameter = self._parameters.get((self._config.node_of(component), where))
        owner = self._tables[component if parameter is None else parameter.component]
        pdos = mapped.get((variable.index, variable.subindex), [])
        found = locked(variable, parameter, owner, self._names, pdos)
        return replace(
            by_eds(variable),
            parameter=None if parameter is None else parameter.name,
            read_only=_read_only(variable, parameter),
            pdos=pdos,
            locked=None if found is None else found.why,
            release=None if found is None else found.lines,
        )

    # -- what the device holds -------------------------------------------------------------------------------

    def _node(self, component: str) -> Any:
        found: Any = self._component.robot.components.get(component)
        return None if found is None else found.node

    def read_all(self, wanted: Sequence[Wanted]) -> "Future[list[ObjectValue]]":
        """Read these for `Reads`: they are of one device."""
        why = {name: self._why_unasked(name) for name in {one.component for one in wanted}}
        asked = [one for one in wanted if why[one.component] is None and self._unreadable(one) is None]
        if not asked:
            return done([self._unread(one, why[one.component]) for one in wanted])
        node = self._node(asked[0].component)
        uploads = gather({"all": node.upload_all([(one.index, one.subindex) for one in asked])})

        def told(found: Mapping[str, Any]) -> list[ObjectValue]:
            values = dict(zip(asked, self._told(asked, node, found["all"]), strict=True))
            return [values.get(one) or self._unread(one, why[one.component]) for one in wanted]

        return then(back(self._loop, uploads), told)

    def _told(
        self, asked: Sequence[Wanted], node: Any, told: "Sequence[bytes | DriverError] | Exception"
    ) -> Iterator[ObjectValue]:
        found: list[bytes | Exception] = [told] if isinstance(told, Exception) else [*told]
        last = found[-1]
        if isinstance(last, DeviceTimeout):
            self._unanswered.note({one.component for one in asked}, node, str(last))
        found += [last] * (len(asked) - len(found))
        return (self._value(one, each) for one, each in zip(asked, found, strict=True))

    def _why_unasked(self, component: str) -> str | None:
        silence = self._silence(component)
        return self._unanswered.why(component) if silence is None else f"{component} is not there: {silence}"

    def _unreadable(self, wanted: Wanted) -> str | None:
        return unreadable(self._description(wanted.component).variable(wanted.index, wanted.subindex))

    def _unread(self, wanted: Wanted, why: str | None) -> ObjectValue:
        return ObjectValue(None, "", None, why or self._unreadable(wanted))

    def _value(self, wanted: Wanted, told: bytes | Exception) -> ObjectValue:
        from drivers.trace.values import value_of  # for who looks at objects only

        if isinstance(told, Exception):
            return ObjectValue(None, "", None, str(told) or "no answer")
        found = value_of(self._description(wanted.component), wanted.index, wanted.subindex, told)
        return ObjectValue(found.value, found.words, time.monotonic_ns())


def address(index: int, subindex: int) -> str:
    """`0x6041:0`, as parameters have it."""
    return f"0x{index:04X}:{subindex}"


def by_eds(variable: "ODVariable") -> ObjectInfo:
    """Return the description of an object from its EDS alone."""
    known, default = DATA_TYPES.get(variable.data_type or 0), variable.default
    return ObjectInfo(
        address(variable.index, variable.subindex),
        variable.qualname,
        "?" if known is None else known.name,
        variable.access_type.lower(),
        variable.min,
        variable.max,
        default if isinstance(default, int | float | str) else None,
        None,
        None,
        remark(variable.name),
    )


def unreadable(variable: "ODVariable | None") -> str | None:
    """Return why an object is not read; `None` if it is."""
    if variable is None or variable.access_type.lower() not in READABLE:
        return "it cannot be read, the EDS says"
    if variable.data_type == DOMAIN:
        return "a domain is not read: nobody knows how long it would keep the device busy"
    return None


def _read_only(variable: "ODVariable", parameter: Parameter | None) -> str | None:
    if variable.access_type.lower() not in WRITABLE:
        return f"{variable.access_type.lower()} in the EDS"
    if parameter is None:
        return "no parameter"
    return parameter.problem or parameter.read_only
