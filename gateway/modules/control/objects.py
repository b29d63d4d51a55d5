"""One object of a device: read, or written as long as nobody objects; what goes wrong is said in words.

For the writer's thread: it waits, but no longer than `ANSWER_S` for one answer, whatever else is asked of
the device.
"""

import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from drivers.bus.sdo.channel import SdoChannel
from drivers.errors import DeviceAbort, DeviceTimeout, DriverError
from gateway.modules.control.parameters import Parameter
from gateway.modules.stop.authority import Address
from gateway.process.futures import outcome
from gateway.wire.framing import ErrorKind, RpcError, refuse

T = TypeVar("T")
K = TypeVar("K")

ANSWER_S = 3.0  # longer than the drivers' own time-outs: beyond, something urgent, a stop, has the device
PATIENCE = 3  # times the usual, for an answer that must be known

Objection = Callable[[Address], str | None]  # why an object must not be written now, in words


class Node(Protocol):
    """A device's objects, as the drivers give them."""

    @property
    def ready(self) -> bool:
        """Whether it has come up."""

    @property
    def distrust(self) -> str | None:
        """Why nothing may be written to it."""

    @property
    def answered_ns(self) -> int:
        """When it last did, or refused, what it was asked (monotonic)."""

    def upload(self, index: int, subindex: int) -> "Future[bytes]": ...

    def upload_all(self, objects: Sequence[tuple[int, int]]) -> "Future[list[bytes | DriverError]]": ...

    def download(
        self,
        index: int,
        subindex: int,
        data: bytes,
        timeout_s: float | None = None,
        permitted: Callable[[], str | None] | None = None,
    ) -> "Future[None]":
        """`permitted` is asked last of all; where it objects, nothing is sent (`NotPermitted`)."""

    def run(self, job: Callable[[Any], T]) -> "Future[T]": ...


@dataclass(frozen=True, slots=True)
class ObjectWrite:
    """One parameter and the bytes it shall hold."""

    parameter: Parameter
    node: Node
    data: bytes

    @property
    def name(self) -> str:
        return self.parameter.name


def result(future: "Future[T]", more_s: float = 0.0) -> T:
    """Return the result of a future; raises `TimeoutError`, and cancels it, if it takes too long."""
    try:
        return future.result(ANSWER_S + more_s)
    except TimeoutError:
        future.cancel()
        raise


def results(futures: "Mapping[K, Future[T]]") -> "dict[K, T | Exception]":
    """Return the results of all futures, in the time of one; an error takes the place of its result."""
    wait(futures.values(), ANSWER_S)
    found: dict[K, T | Exception] = dict.fromkeys(futures, TimeoutError("no answer"))
    for key, future in futures.items():
        if future.done():
            told = outcome(future)
            found[key] = told
        future.cancel()
    return found


def read(parameter: Parameter, node: Node) -> bytes:
    """Return the device's bytes now.

    Raises:
        RpcError: the device does not tell.

    """
    try:
        return result(node.upload(parameter.index, parameter.subindex))
    except (DriverError, TimeoutError) as error:
        raise device_error(parameter, "reading", error) from error


def ask_patiently(node: Node, address: Address) -> "Future[bytes]":
    """Read a value that must be known: without an answer, ask once more and wait longer."""
    _bus, _node_id, index, subindex = address

    def ask(sdo: SdoChannel) -> bytes:
        try:
            return sdo.upload(index, subindex, attempts=1)
        except DeviceTimeout:
            return sdo.upload(index, subindex, attempts=1, timeout_s=PATIENCE * sdo.timeout_s)

    return node.run(ask)


def download(
    node: Node, address: Address, data: bytes, objection: Objection, timeout_s: float | None = None
) -> None:
    """Write it, unless there is an `objection` at the last moment.

    Raises:
        NotPermitted: it was not sent.
        DriverError: the device refused; or, a `DeviceTimeout`, nobody knows.
        TimeoutError: nobody knows; what was not sent by now is not sent any more.

    """
    _bus, _node_id, index, subindex = address
    given_up = threading.Event()

    def permitted() -> str | None:
        return "nobody waits for it any more" if given_up.is_set() else objection(address)

    try:
        result(node.download(index, subindex, data, timeout_s, permitted=permitted), timeout_s or 0.0)
    except TimeoutError:
        given_up.set()
        raise


def device_error(parameter: Parameter, doing: str, error: Exception) -> RpcError:
    """Return a driver's error as an answer for the client."""
    kinds = ((DeviceAbort, ErrorKind.DEVICE_ABORT), (TimeoutError, ErrorKind.DEVICE_TIMEOUT))
    kind = next((kind for type_, kind in kinds if isinstance(error, type_)), ErrorKind.UNAVAILABLE)
    return refuse(
        kind,
        f"{parameter.name}: {doing} {parameter.object}: {str(error) or 'no answer'}",
        component=parameter.component,
        object=parameter.object,
        abort_code=getattr(error, "abort_code", None),
    )
