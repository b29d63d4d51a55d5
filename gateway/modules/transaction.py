"""One write of several parameters: all or nothing, each verified by reading it back.

Current values are read first; everything is checked before the first download; what is to be taken back is on
disk, and in the journal, before it; whatever goes wrong afterwards takes back all that may have changed, in
reverse order, verified. Runs in the control module's own thread.
"""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Protocol

from drivers.errors import DeviceAbort, DriverError
from gateway.modules.parameters import Parameter
from gateway.wire import Kind, RpcError, refuse

ANSWER_S = 30.0  # longer than any driver's own time-outs: only a driver's bug gets here


class Node(Protocol):
    """A device's objects, as the drivers give them."""

    def upload(self, index: int, subindex: int) -> "Future[bytes]": ...

    def download(self, index: int, subindex: int, data: bytes) -> "Future[None]": ...


@dataclass(frozen=True, slots=True)
class Change:
    """One parameter and the bytes it shall hold."""

    parameter: Parameter
    node: Node
    data: bytes


class Ledger(Protocol):
    """Where a write is kept beyond the process. Each call returns when that is durable."""

    def begin(self, before: Mapping[str, bytes]) -> None:
        """Before the first download; raises `RpcError` where it cannot be kept, and nothing is written."""

    def done(self) -> None:
        """Everything is written and verified."""

    def refused(self, error: RpcError) -> None:
        """Nothing was written, and nothing begun."""

    def taken_back(self, error: RpcError) -> None:
        """Nothing is written any more."""

    def left(self, error: RpcError) -> None:
        """Some of it could not be taken back."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Values as the devices hold them."""

    before: dict[str, float]
    after: dict[str, float]


def device_error(parameter: Parameter, doing: str, error: Exception) -> RpcError:
    """What a driver could not do, as an answer."""
    kinds = ((DeviceAbort, Kind.DEVICE_ABORT), (TimeoutError, Kind.DEVICE_TIMEOUT))
    kind = next((kind for type_, kind in kinds if isinstance(error, type_)), Kind.UNAVAILABLE)
    return refuse(
        kind,
        f"{parameter.name}: {doing} {parameter.object}: {error}",
        component=parameter.component,
        object=parameter.object,
        abort_code=getattr(error, "abort_code", None),
    )


def read(parameter: Parameter, node: Node) -> bytes:
    """The device's bytes now.

    Raises:
        RpcError: the device does not tell.

    """
    try:
        return node.upload(parameter.index, parameter.subindex).result(ANSWER_S)
    except (DriverError, TimeoutError) as error:
        raise device_error(parameter, "reading", error) from error


class Transaction:
    """One write. `check` is given each change with its current value and raises `RpcError` to refuse."""

    def __init__(
        self,
        changes: list[Change],
        check: Callable[[Change, float], None],
        stopped: threading.Event,
        ledger: Ledger,
    ) -> None:
        self._changes = changes
        self._check = check
        self._stopped = stopped
        self._ledger = ledger
        self._before: dict[str, bytes] = {}
        self._touched: list[Change] = []

    def run(self) -> Outcome:
        """Do it.

        Raises:
            RpcError: nothing has changed; or everything was taken back (rolled_back); or that failed
                (rollback_failed), and `outcome` says what each parameter holds.

        """
        try:
            self._prepare()
        except RpcError as error:
            self._ledger.refused(error)
            raise
        try:
            for change in self._changes:
                self._apply(change)
            self._ledger.done()
        except RpcError as error:
            raise self._roll_back(error) from error
        return Outcome(
            {one.parameter.name: self._value_before(one) for one in self._changes},
            {one.parameter.name: one.parameter.decode(one.data) for one in self._changes},
        )

    def _prepare(self) -> None:
        """Read, check, and put into a safe order.

        What becomes smaller comes first, so that a torque or a speed is limited before a gain grows; taking
        back goes the other way round.
        """
        for change in self._changes:
            self._before[change.parameter.name] = read(change.parameter, change.node)
        for change in self._changes:
            self._check(change, self._value_before(change))
        self._changes.sort(key=lambda one: abs(one.parameter.decode(one.data)) > abs(self._value_before(one)))
        self._ledger.begin(self._before)

    def _value_before(self, change: Change) -> float:
        return change.parameter.decode(self._before[change.parameter.name])

    def _apply(self, change: Change) -> None:
        if self._stopped.is_set():
            raise change.parameter.refusal(Kind.STOPPED, "the robot was stopped before this was written")
        self._touched.append(change)
        _write(change, change.data)

    def _roll_back(self, cause: RpcError) -> RpcError:
        outcome = {change.parameter.name: "not written" for change in self._changes}
        for change in reversed(self._touched):
            outcome[change.parameter.name] = self._restore(change)
        failed = [name for name, what in outcome.items() if what not in _HARMLESS]
        taken_back = any(what == _TAKEN_BACK for what in outcome.values())
        kind = Kind.ROLLBACK_FAILED if failed else Kind.ROLLED_BACK if taken_back else cause.kind
        text = str(cause)
        if failed:
            text += f"; and could not be taken back: {', '.join(failed)}; read them before you go on"
        elif taken_back:
            text += "; everything was taken back"
        data = cause.data
        answer = refuse(
            kind,
            text,
            component=data.component,
            object=data.object,
            abort_code=data.abort_code,
            limit=data.limit,
            outcome=outcome,
        )
        if failed:
            self._ledger.left(answer)
        else:
            self._ledger.taken_back(answer)
        return answer

    def _restore(self, change: Change) -> str:
        """Bring one parameter back, and say what became of it."""
        before = self._before[change.parameter.name]
        try:
            if read(change.parameter, change.node) == before:
                return _UNCHANGED
            _write(change, before)
        except RpcError as error:
            return f"unknown: {error}"
        return _TAKEN_BACK


_UNCHANGED = "unchanged"
_TAKEN_BACK = "taken back"
_HARMLESS = ("not written", _UNCHANGED, _TAKEN_BACK)


def _write(change: Change, data: bytes) -> None:
    parameter, node = change.parameter, change.node
    try:
        node.download(parameter.index, parameter.subindex, data).result(ANSWER_S)
    except (DriverError, TimeoutError) as error:
        raise device_error(parameter, f"writing {parameter.decode(data):g} to", error) from error
    found = read(parameter, node)
    if found != data:
        text = (
            f"{parameter.decode(data):g} was written, the device holds {found.hex(' ')} ({parameter.object})"
        )
        raise parameter.refusal(Kind.MISMATCH, text)
