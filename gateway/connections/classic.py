"""The process list as the paper's daemon gives it (its Algorithm 1): the length, then piece after piece.

A client connects, sends anything, and gets the length of the JSON list as text; then, with one connection
each, the next at most 8,000 bytes. So it is the client's address that tells exchanges apart: one at a time
for each, forgotten `EXPIRES_S` after its last connection. CPU percentages are since the same address's last
exchange, `null` where it is forgotten or was the first.
"""

import logging
import socket
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from typing import Any, Protocol, TypeVar

import msgspec

from gateway.connections.acceptor import Acceptor
from gateway.process.futures import done, then
from gateway.process.loop import READ, WRITE, Loop, Timer
from gateway.wire.resource import ResourceSnapshot, ResourceSnapshotParams

log = logging.getLogger(__name__)

PIECE_BYTES = 8000
EXPIRES_S = 10.0
CALL_S = 5.0  # how long one connection may take
MOST_CALLS = 32  # connections at a time
MOST_EXCHANGES = 16
_RECEIVE_BYTES = 4096
_EVERYTHING = ResourceSnapshotParams(sort="pid")


class Entry(msgspec.Struct, frozen=True, gc=False):
    """One process: `cpu` in percent of one core, `mem` its resident set in bytes."""

    name: str
    pid: int
    cpu: float | None
    mem: int


class Measuring(Protocol):
    """The resource module, as far as it is needed here; a meter's percentages are since its own last look."""

    def meter(self) -> Any: ...

    def look(self, meter: Any, params: ResourceSnapshotParams) -> "Future[ResourceSnapshot]": ...


M = TypeVar("M", bound=Measuring)


class _Exchange:
    """One address's exchange: its meter, and what of the list it has not fetched yet."""

    def __init__(self) -> None:
        self.expiry: Timer | None = None
        self._meter: Any = None
        self._rest = b""

    def next_piece(self, resource: Measuring) -> "Future[bytes]":
        """Return the next bytes of the list; where none are left, a new list's length."""
        if self._rest:
            piece, self._rest = self._rest[:PIECE_BYTES], self._rest[PIECE_BYTES:]
            return done(piece)
        if self._meter is None:
            self._meter = resource.meter()
        return then(resource.look(self._meter, _EVERYTHING), self._begin)

    def _begin(self, snapshot: ResourceSnapshot) -> bytes:
        rows = snapshot.processes or []
        self._rest = msgspec.json.encode(
            [Entry(row.name, row.pid, row.cpu_percent, row.memory_bytes) for row in rows]
        )
        return str(len(self._rest)).encode()


class ClassicPort:
    """The second listening socket, its calls and exchanges."""

    def __init__(
        self,
        loop: Loop,
        listener: socket.socket,
        use: "Callable[[Hashable], Future[M]]",
        leave: Callable[[Hashable], None],
        left: Callable[[], None],
        *,
        is_served: bool = True,
    ) -> None:
        """`use` gives the module, running until its user leaves; `left` is told when a client has gone.

        Where it is not served, whoever comes is sent away.
        """
        self._is_served = is_served
        self._loop = loop
        self._listener = listener
        self._next_piece: Callable[[_Exchange], Future[bytes]] = lambda exchange: then(
            use(exchange), exchange.next_piece
        )
        self._leave = leave
        self._left = left
        self._calls: set[_Call] = set()
        self._exchanges: dict[str, _Exchange] = {}
        self._acceptor = Acceptor(loop, listener, self._opened)
        self._acceptor.start()

    @property
    def port(self) -> int:
        return int(self._listener.getsockname()[1])

    @property
    def busy(self) -> bool:
        """Whether somebody is connected, or in the midst of an exchange."""
        return bool(self._calls or self._exchanges)

    def close(self, *, given_back: bool) -> None:
        """End every call, and give the port back where it is nobody's any more."""
        self._acceptor.end()
        if given_back:
            self._listener.close()
        for call in tuple(self._calls):
            call.close()

    def _opened(self, connection: socket.socket, address: Any) -> None:
        source = str(address[0])
        full = len(self._exchanges) >= MOST_EXCHANGES and source not in self._exchanges
        if not self._is_served or full or len(self._calls) >= MOST_CALLS:
            connection.close()
            return
        call = _Call(self._loop, connection, lambda: self._answer(source), self._ended)
        self._calls.add(call)

    def _ended(self, call: "_Call") -> None:
        self._calls.discard(call)
        self._left()

    def _answer(self, source: str) -> "Future[bytes]":
        exchange = self._exchanges.setdefault(source, _Exchange())
        if exchange.expiry is not None:
            exchange.expiry.cancel()
        exchange.expiry = self._loop.call_later(EXPIRES_S, lambda: self._expire(source))
        return self._next_piece(exchange)

    def _expire(self, source: str) -> None:
        self._leave(self._exchanges.pop(source))
        self._left()


class _Call:
    """One connection: the client says anything, is answered, and both close."""

    def __init__(
        self,
        loop: Loop,
        connection: socket.socket,
        answer: Callable[[], "Future[bytes]"],
        ended: Callable[["_Call"], None],
    ) -> None:
        self._loop = loop
        self._socket = connection
        self._ask = answer
        self._ended = ended
        self._asked = self._closed = False
        self._output = b""
        connection.setblocking(False)
        self._late = loop.call_later(CALL_S, self.close)
        loop.watch(connection, READ, self._on_ready)

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        self._late.cancel()
        self._loop.watch(self._socket, 0, self._on_ready)
        self._socket.close()
        self._ended(self)

    def _on_ready(self, _events: int) -> None:
        try:
            if self._output:
                self._send()
            elif not self._socket.recv(_RECEIVE_BYTES):
                self.close()
            elif not self._asked:
                self._asked = True
                self._ask().add_done_callback(lambda piece: self._loop.call(lambda: self._answer(piece)))
        except BlockingIOError:
            return
        except OSError as error:
            log.info("a client of the classic port: %s", error)
            self.close()

    def _answer(self, piece: "Future[bytes]") -> None:
        error = piece.exception()
        if error is not None:
            log.error("a client of the classic port gets no answer: %s", error)
            self.close()
        elif not self._closed:
            self._output = piece.result()
            self._on_ready(WRITE)

    def _send(self) -> None:
        """Send as much as the socket takes; after the last byte shut down, and await the client's end."""
        self._output = self._output[self._socket.send(self._output) :]
        if not self._output:
            self._socket.shutdown(socket.SHUT_WR)
        waits_for = WRITE if self._output else READ
        self._loop.watch(self._socket, waits_for, self._on_ready)
