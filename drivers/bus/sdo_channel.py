"""Blocking SDO transfers over one channel to one node, errors in the drivers' own words.

A read that stays unanswered is repeated; a write never is, because the device may have taken it.
"""

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TypeVar

from drivers.bus import sdo
from drivers.bus.aborts import abort_text
from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable

T = TypeVar("T")

READ_ATTEMPTS = 3


class Interrupted(Exception):
    """An urgent job wants the channel: the running one ends here and, as far as it only read, runs again."""


class SdoProtocolBroken(DeviceTimeout):
    """The device answered, but not as the SDO protocol says: nothing is known about the transfer."""


@dataclass(slots=True)
class SdoCounters:
    """What happened on one channel."""

    transfers: int = 0
    timeouts: int = 0
    aborts: int = 0
    stale: int = 0  # responses that belonged to no request


class SdoChannel:
    """One SDO channel. `upload` and `download` are for one thread; the rest for any."""

    def __init__(self, label: str, send: Callable[[bytes], None], timeout_s: float) -> None:
        """`send` puts a request on the bus, or raises `Unavailable`."""
        self.label = label
        self.timeout_s = timeout_s
        self.counters = SdoCounters()
        self.written: dict[
            tuple[int, int], bytes
        ] = {}  # what each object was sent last, since the node came up
        self._send = send
        self._inbox: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._interrupted = threading.Event()
        self._sending = threading.Lock()  # so that nothing goes out behind what interrupted it
        self._in_flight: tuple[int, int] | None = None  # the object that a transfer is about
        self._ahead: bytes | None = None  # a request that went out before the job that waits for its answer

    def on_response(self, _stamp_ns: int, data: bytes) -> None:
        """A frame with the identifier of this channel's responses; called in the bus's thread."""
        if len(data) == 8:
            self._inbox.put(data)

    def interrupt(self, ahead: bytes | None = None) -> None:
        """End the transfer in flight, refuse further ones until `resume`, and send a request `ahead`.

        The job that comes next finds that request sent when it makes it, and waits for the answer. The one
        that is interrupted learns of it when it next turns here, or by `wake`.
        """
        with self._sending:
            self._interrupted.set()
            self._ahead = None
            with contextlib.suppress(Unavailable):  # whoever waits for an answer is told
                if self._in_flight is not None:
                    self._send(sdo.abort_request(*self._in_flight, sdo.GENERAL_ERROR))
                if ahead is not None:
                    self._send(ahead)
                    self._ahead = ahead
            self._in_flight = None

    def wake(self) -> None:
        """Let a job that waits for an answer look whether it was interrupted."""
        self._inbox.put(None)

    def resume(self) -> None:
        """Allow transfers again."""
        self._interrupted.clear()

    def upload(
        self, index: int, subindex: int, attempts: int = READ_ATTEMPTS, timeout_s: float | None = None
    ) -> bytes:
        """Read an object; raises `DeviceAbort`, `DeviceTimeout` or `Unavailable`."""
        what = f"{self.label}: reading 0x{index:04X}:{subindex:02X}"
        wait_s = timeout_s or self.timeout_s
        for _ in range(attempts - 1):
            try:
                return self._transfer(sdo.upload(index, subindex), index, subindex, what, wait_s)
            except DeviceTimeout:
                continue
        return self._transfer(sdo.upload(index, subindex), index, subindex, what, wait_s)

    def download(self, index: int, subindex: int, data: bytes, timeout_s: float | None = None) -> None:
        """Write an object, once; raises `DeviceAbort`, `DeviceTimeout` or `Unavailable`."""
        self._check_interrupted()
        what = f"{self.label}: writing {value_text(data)} to 0x{index:04X}:{subindex:02X}"
        unknown = "whether the device took it is not known, read it back"
        self.written[index, subindex] = data
        try:
            wait_s = timeout_s or self.timeout_s
            self._transfer(sdo.download(index, subindex, data), index, subindex, what, wait_s)
        except Interrupted as error:
            raise DeviceTimeout(f"{what}: interrupted by an urgent request; {unknown}") from error
        except DeviceTimeout as error:
            raise DeviceTimeout(f"{error}; {unknown}") from error

    def _transfer(
        self, steps: Generator[bytes | None, bytes, T], index: int, subindex: int, what: str, timeout_s: float
    ) -> T:
        self._check_interrupted()
        if self._ahead is None:
            self._forget_stale()
        self.counters.transfers += 1
        try:
            return self._run(steps, (index, subindex), timeout_s)
        except sdo.SdoAborted as error:
            self.counters.aborts += 1
            raise DeviceAbort(f"{what}: refused, {abort_text(error.abort_code)}", error.abort_code) from error
        except sdo.SdoProtocolError as error:
            self._abort(index, subindex, error.abort_code)
            raise SdoProtocolBroken(f"{what}: the device {error}, against the SDO protocol") from error
        except queue.Empty as error:
            self.counters.timeouts += 1
            self._abort(index, subindex, sdo.TIMED_OUT)
            raise DeviceTimeout(f"{what}: no answer within {timeout_s:g} s") from error
        finally:
            self._in_flight = None

    def _run(self, steps: Generator[bytes | None, bytes, T], about: tuple[int, int], timeout_s: float) -> T:
        try:
            request = next(steps)
            while True:
                if request is None:
                    self.counters.stale += 1
                else:
                    self._ask(request, about)
                    deadline = time.monotonic() + timeout_s
                request = steps.send(self._response(deadline))
        except StopIteration as done:
            result: T = done.value
            return result

    def _ask(self, request: bytes, about: tuple[int, int]) -> None:
        with self._sending:
            self._check_interrupted()
            self._in_flight = about
            if request != self._ahead:
                self._send(request)
            self._ahead = None

    def _abort(self, index: int, subindex: int, abort_code: int) -> None:
        with self._sending:
            if not self._interrupted.is_set():  # else it was sent, and something else is in flight
                self._send(sdo.abort_request(index, subindex, abort_code))

    def _response(self, deadline: float) -> bytes:
        """The next response; raises `queue.Empty` at the deadline and `Interrupted`."""
        while True:
            response = self._inbox.get(timeout=max(0.0, deadline - time.monotonic()))
            if self._interrupted.is_set():
                self._inbox.put(response)  # it may be the answer to what was sent ahead
                raise Interrupted
            if response is not None:
                return response

    def _check_interrupted(self) -> None:
        if self._interrupted.is_set():
            raise Interrupted

    def _forget_stale(self) -> None:
        while True:
            try:
                response = self._inbox.get_nowait()
            except queue.Empty:
                return
            self.counters.stale += response is not None


def value_text(data: bytes) -> str:
    """Bytes as a number where they can be one: `5000 (88 13)`."""
    number = f"{int.from_bytes(data, 'little')} " if len(data) in (1, 2, 4, 8) else ""
    return f"{number}({data[:16].hex(' ')}{' …' if len(data) > 16 else ''})"
