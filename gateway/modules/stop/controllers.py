"""A stop of the controllers that command the drives: their configured objects are written, and read back."""

import time
from collections.abc import Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from drivers.bus.sdo import EXPEDITED, expedited
from drivers.bus.sdo_channel import SdoChannel
from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable
from drivers.joint.quick_stop import FIRST_PATIENCE_S, READ_PERIOD_S, StopOutcome
from eds import Description
from eds.datatypes import DATA_TYPES
from gateway.coding import NUMBERS, Coding, CodingError
from gateway.futures import failed
from gateway.modules.stop.settings import ControllerStop
from gateway.modules.stop.target import Report

INSIST_S = 1.0  # how long a controller may take to confirm


@dataclass(frozen=True, slots=True)
class Write:
    """One object and the bytes that stop the controller."""

    index: int
    subindex: int
    data: bytes


class Controller:
    """One controller with all its objects, which is stopped once at a time."""

    def __init__(self, node: Any, writes: tuple[Write, ...]) -> None:
        self._node = node
        self._writes = writes
        self._running: Future[Report] | None = None

    def stop(self, *, wake: bool = True) -> "Future[Report]":
        """Write ahead of everything else that is asked of its node; see `Node.run`. Never raises."""
        if self._running is None or self._running.done():
            self._running = self._begin(wake=wake)
        return self._running

    def _begin(self, *, wake: bool) -> "Future[Report]":
        first = self._writes[0]
        ahead = expedited(first.index, first.subindex, first.data) if len(first.data) <= EXPEDITED else None
        deadline = time.monotonic() + INSIST_S
        try:
            found: Future[Report] = self._node.run(
                lambda sdo: Report(insist(sdo, self._writes, deadline)), urgent=True, ahead=ahead, wake=wake
            )
        except Exception as error:  # noqa: BLE001 - the drives are to be stopped all the same
            return failed(error)
        return found

    def wake(self) -> None:
        self._node.wake()


class Controllers:
    """All of `[[stop.controller]]`; and why some of them cannot be stopped."""

    def __init__(
        self,
        settings: Iterable[ControllerStop],
        components: Mapping[str, Any],
        descriptions: Mapping[str, Description],
    ) -> None:
        self.absent: dict[str, str] = {}
        writes: dict[str, tuple[Write, ...]] = {}
        for one in settings:
            try:
                write = _write(one, components, descriptions)
            except CodingError as error:
                self.absent[one.component] = str(error)
            else:
                writes[one.component] = (*writes.get(one.component, ()), write)
        self.targets = {
            name: Controller(components[name].node, all_)
            for name, all_ in writes.items()
            if name not in self.absent
        }

    @property
    def names(self) -> frozenset[str]:
        return frozenset((*self.targets, *self.absent))


def _write(
    one: ControllerStop, components: Mapping[str, Any], descriptions: Mapping[str, Description]
) -> Write:
    where = f"[[stop.controller]] {one.component} {one.object}"
    if one.component not in components or one.component not in descriptions:
        raise CodingError(f"{where}: it is not there")
    variable = descriptions[one.component].variable(*one.address)
    known = None if variable is None else DATA_TYPES.get(variable.data_type or 0)
    if variable is None or known is None or known.kind not in NUMBERS:
        raise CodingError(f"{where}: its EDS has no such number")
    try:
        return Write(*one.address, Coding(variable.data_type or 0).encode(one.value))
    except CodingError as error:
        raise CodingError(f"{where}: {error}") from error


def insist(sdo: SdoChannel, writes: tuple[Write, ...], deadline: float) -> StopOutcome:
    """Write until the device holds all of it, or the time is over. A job of the node's worker."""
    answered = False
    patience_s = FIRST_PATIENCE_S
    while time.monotonic() < deadline:
        try:
            if _write_all(sdo, writes, min(patience_s, sdo.timeout_s)):
                return StopOutcome.CONFIRMED
            answered = True
        except DeviceAbort:
            answered = True
        except DeviceTimeout:
            patience_s *= 2
        except Unavailable:
            break
        time.sleep(READ_PERIOD_S)
    return StopOutcome.UNCONFIRMED if answered else StopOutcome.UNREACHABLE


def _write_all(sdo: SdoChannel, writes: tuple[Write, ...], patience_s: float) -> bool:
    for one in writes:
        sdo.download(one.index, one.subindex, one.data, patience_s)
    return all(
        sdo.upload(one.index, one.subindex, attempts=1, timeout_s=patience_s)[: len(one.data)] == one.data
        for one in writes
    )
