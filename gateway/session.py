"""One client's connection: lines in, answers and streams out, everything bounded.

Where a client is slow, it is the client that loses: its requests wait, its streams drop rows, and one that
takes nothing for `stuck_s` is closed. Nobody else waits for it.
"""

import functools
import logging
import selectors
import socket
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Concatenate, ParamSpec, Protocol

from msgspec import UNSET

from gateway import messages, wire
from gateway.futures import outcome
from gateway.loop import Loop, Timer

log = logging.getLogger(__name__)

RECEIVE_BYTES = 64 * 1024
QUEUED_LINES = 256  # requests waiting to be handled before reading pauses
PENDING = 64  # requests waiting for a device before the next is handled
OUTPUT_BYTES = 1024 * 1024  # answers not yet taken before the next request is handled
STREAM_BYTES = 64 * 1024  # output not yet taken before streams hold back

# Whether the peer is still there: asked by the kernel after 10 s of silence, given up after 15 s more.
_KEEPALIVE = {"TCP_KEEPIDLE": 10, "TCP_KEEPINTVL": 5, "TCP_KEEPCNT": 3, "TCP_USER_TIMEOUT": 25_000}

Answer = object | Future[object]
P = ParamSpec("P")


class Outlet(Protocol):
    """A stream's end at one client."""

    def next_line(self) -> bytes | None:
        """The next notification, or `None` when there is none yet."""


def _spends(work: "Callable[Concatenate[Session, P], None]") -> "Callable[Concatenate[Session, P], None]":
    """Put down on the session's account what the thread works in this method and all that it calls."""

    @functools.wraps(work)
    def metered(session: "Session", /, *args: P.args, **options: P.kwargs) -> None:
        if session.spending:
            work(session, *args, **options)
            return
        session.spending, began_ns = True, time.thread_time_ns()
        try:
            work(session, *args, **options)
        finally:
            session.cpu_ns += time.thread_time_ns() - began_ns
            session.spending = False

    return metered


class Session:
    """A connection from accept to close. It belongs to the loop's thread."""

    def __init__(
        self,
        loop: Loop,
        connection: socket.socket,
        peer: str,
        handle: "Callable[[Session, wire.Request], Answer]",
        stuck_s: float,
    ) -> None:
        self.peer = peer
        self.who = peer  # how the journal calls it
        self.cpu_ns = 0  # that the loop has worked for it
        self.requests = self.received_bytes = self.sent_bytes = 0
        self.outlets: dict[int, Outlet] = {}
        self.closed = False
        self._loop = loop
        self._socket = connection
        self._handle = handle
        self._stuck_s = stuck_s
        self.spending = False  # whether what is worked now is put down already
        self._splitter = wire.LineSplitter()
        self._queue: deque[wire.Request | wire.BadLine] = deque()
        self._scheduled = False
        self._pending = 0
        self._output: deque[memoryview] = deque()
        self._output_bytes = 0
        self._input_ended = False
        self._stuck: Timer | None = None
        self._moved_ns = 0
        self._farewells: list[Callable[[], None]] = []
        _prepare(connection)
        self._watch()

    @property
    def waiting_bytes(self) -> int:
        """Of answers and streams that the client has not taken."""
        return self._output_bytes

    def on_close(self, farewell: Callable[[], None]) -> None:
        """Call `farewell` when the connection has ended."""
        self._farewells.append(farewell)

    def send(self, line: bytes) -> None:
        """Queue one line and send what the socket takes now."""
        if not self.closed:
            self._enqueue(line)
            self._flush()

    @_spends
    def pump(self) -> None:
        """Send what the streams have, as far as the client keeps up."""
        if self.closed:
            return
        progress = True
        while progress and self._output_bytes < STREAM_BYTES:
            progress = False
            for outlet in tuple(self.outlets.values()):
                line = outlet.next_line()
                if line is not None:
                    self._enqueue(line)
                    progress = True
        self._flush()

    def close(self) -> None:
        """End the connection and tell everybody who serves it; idempotent."""
        if self.closed:
            return
        self.closed = True
        self._loop.watch(self._socket, 0, self._on_ready)
        self._socket.close()
        if self._stuck is not None:
            self._stuck.cancel()
        self._queue.clear()
        self._output.clear()
        self.outlets.clear()
        for farewell in self._farewells:
            farewell()

    # Reading

    @_spends
    def _on_ready(self, events: int) -> None:
        if events & selectors.EVENT_WRITE:
            self._flush()
            self.pump()
        if events & selectors.EVENT_READ and not self.closed:
            self._receive()

    def _receive(self) -> None:
        try:
            data = self._socket.recv(RECEIVE_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            log.info("%s: %s", self.peer, error)
            self.close()
            return
        self.received_bytes += len(data)
        self._input_ended = not data
        for line in self._splitter.feed(data) if data else self._splitter.end():
            self._take(line)
        self._schedule()
        self._watch()
        self._finish_if_done()

    def _take(self, line: bytes | wire.BadLine) -> None:
        request: wire.Request | wire.BadLine
        try:
            request = wire.decode_request(line) if isinstance(line, bytes) else line
        except wire.BadLine as error:
            request = error
        method = messages.METHODS.get(request.method) if isinstance(request, wire.Request) else None
        if method is not None and method.urgent:
            self._run(request)
        else:
            self._queue.append(request)

    # Answering

    def _schedule(self) -> None:
        """One request a turn of the loop, so that a client that sends a thousand does not keep the others."""
        if (
            self._queue
            and not self._scheduled
            and self._pending < PENDING
            and self._output_bytes < OUTPUT_BYTES
        ):
            self._scheduled = True
            self._loop.post(self._run_next)

    @_spends
    def _run_next(self) -> None:
        self._scheduled = False
        if not self.closed and self._queue:
            self._run(self._queue.popleft())
            self._schedule()
            self._watch()
            self._finish_if_done()

    def _run(self, request: wire.Request | wire.BadLine) -> None:
        if isinstance(request, wire.BadLine):
            self.send(wire.encode_error(request.id, request))
            return
        self.requests += 1
        try:
            answer = self._handle(self, request)
        except Exception as error:  # noqa: BLE001 - whatever it is, this client is told and the others never notice
            answer = error
        if isinstance(answer, Future):
            self._pending += 1
            answer.add_done_callback(lambda future: self._loop.call(lambda: self._complete(request, future)))
        else:
            self._answer(request, answer)

    @_spends
    def _complete(self, request: wire.Request, future: Future[object]) -> None:
        self._pending -= 1
        self._answer(request, outcome(future))
        self._schedule()
        self._finish_if_done()

    def _answer(self, request: wire.Request, answer: object) -> None:
        if isinstance(answer, Exception) and not isinstance(answer, wire.RpcError):
            log.error("%s from %s failed", request.method, self.peer, exc_info=answer)
            answer = wire.internal_error(request.method, answer)
        if request.id is UNSET:
            return
        if isinstance(answer, wire.RpcError):
            self.send(wire.encode_error(request.id, answer))
        else:
            self.send(wire.encode_result(request.id, answer))

    def _finish_if_done(self) -> None:
        """A client that has half-closed gets its answers and the streams it asked for, then the end."""
        if self._input_ended and not (self._queue or self._pending or self._output or self.outlets):
            self.close()

    # Writing

    def _enqueue(self, line: bytes) -> None:
        self._output.append(memoryview(line))
        self._output_bytes += len(line)

    def _flush(self) -> None:
        """Send until the socket takes no more; what is left goes when it does."""
        sent_any = False
        try:
            while self._output:
                sent = self._socket.send(self._output[0])
                sent_any = True
                self.sent_bytes += sent
                self._output_bytes -= sent
                if sent < len(self._output[0]):
                    self._output[0] = self._output[0][sent:]
                else:
                    self._output.popleft()
        except BlockingIOError:
            pass
        except OSError as error:
            log.info("%s: %s", self.peer, error)
            self.close()
            return
        if sent_any:
            self._moved_ns = time.monotonic_ns()
        if self._output and self._stuck is None:
            self._moved_ns = time.monotonic_ns()
            self._stuck = self._loop.call_later(self._stuck_s, self._check_stuck)
        self._schedule()
        self._watch()
        self._finish_if_done()

    def _check_stuck(self) -> None:
        self._stuck = None
        if not self._output:
            return
        still_s = self._stuck_s - (time.monotonic_ns() - self._moved_ns) / 1e9
        if still_s > 0:
            self._stuck = self._loop.call_later(still_s, self._check_stuck)
        else:
            log.warning("%s takes nothing for %g s; closed", self.peer, self._stuck_s)
            self.close()

    def _watch(self) -> None:
        if self.closed:
            return
        reading = not self._input_ended and len(self._queue) < QUEUED_LINES
        events = selectors.EVENT_READ * reading | selectors.EVENT_WRITE * bool(self._output)
        self._loop.watch(self._socket, events, self._on_ready)


def _prepare(connection: socket.socket) -> None:
    connection.setblocking(False)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    # What waits in the kernel is old when it arrives: keep it short.
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 256 * 1024)
    for name, value in _KEEPALIVE.items():
        option = getattr(socket, name, None)  # not every system has every one
        if option is not None:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)
