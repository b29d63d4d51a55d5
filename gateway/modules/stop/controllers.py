"""A stop of the controllers that command the drives: their configured objects are written, and read back."""

import time
from collections.abc import Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.sdo.protocol import EXPEDITED, expedited
from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable
from drivers.joint.quick_stop import FIRST_PATIENCE_S, READ_PERIOD_S, StopOutcome
from eds import Description
from eds.datatypes import DATA_TYPES
from gateway.coding import NUMBERS, Coding, CodingError
from gateway.config.stop import ControllerStop
from gateway.modules.stop.machine import ResetFinding
from gateway.modules.stop.target import OneAtATime, Report
from gateway.process.futures import failed

INSIST_S = 1.0  # how long a controller may take to confirm


@dataclass(frozen=True, slots=True)
class Write:
    """One object and the bytes that stop the controller."""

    index: int
    subindex: int
    data: bytes


class Controller:
    """One controller with all its objects."""

    def __init__(self, node: Any, writes: tuple[Write, ...]) -> None:
        self.node = node
        self.writes = writes
        self._stops = OneAtATime(self._begin)

    @property
    def running(self) -> bool:
        return self._stops.running

    def stop(self, *, wake: bool = True) -> "Future[Report]":
        """Write ahead of everything else that is asked of its node; see `Node.run`. Never raises."""
        return self._stops.ask(wake=wake)

    def _begin(self, wake: bool) -> "Future[Report]":
        first = self.writes[0]
        ahead = expedited(first.index, first.subindex, first.data) if len(first.data) <= EXPEDITED else None
        try:
            found: Future[Report] = self.node.run(
                lambda sdo: Report(insist(sdo, self.writes)), urgent=True, ahead=ahead, wake=wake
            )
        except Exception as error:  # noqa: BLE001 - the drives are to be stopped all the same
            return failed(error)
        return found

    def wake(self) -> None:
        self.node.wake()

    def look(self) -> "Future[ResetFinding]":
        """Read whether it is stopped; fails with `DriverError` where it does not tell."""
        found: Future[ResetFinding] = self.node.run(lambda sdo: _read_all(sdo, self.writes))
        return found


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
    try:
        return write_of(one, descriptions[one.component])
    except CodingError as error:
        raise CodingError(f"{where}: {error}") from error


def write_of(one: ControllerStop, description: Description) -> Write:
    """Return the write that stops a controller; raises `CodingError` if its EDS has no such number."""
    variable = description.variable(*one.address)
    known = None if variable is None else DATA_TYPES.get(variable.data_type or 0)
    if variable is None or known is None or known.kind not in NUMBERS:
        raise CodingError("its EDS has no such number")
    return Write(*one.address, Coding(variable.data_type or 0).encode(one.value))


def insist(sdo: SdoChannel, writes: tuple[Write, ...]) -> StopOutcome:
    """Write until the device holds all of it, or `INSIST_S` is over. A job of the node's worker."""
    deadline = time.monotonic() + INSIST_S
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
    return _read_all(sdo, writes, patience_s).at_rest


def _read_all(sdo: SdoChannel, writes: tuple[Write, ...], patience_s: float | None = None) -> ResetFinding:
    asked_ns = time.monotonic_ns()
    held = [sdo.upload(one.index, one.subindex, attempts=1, timeout_s=patience_s) for one in writes]
    return ResetFinding(
        all(data[: len(one.data)] == one.data for one, data in zip(writes, held, strict=True)), asked_ns
    )
