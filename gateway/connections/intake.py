"""The thread that accepts clients and reads from all of them.

Even if the main loop hangs or is busy, a stop goes from here to the drives.
"""

import socket
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from drivers.realtime_priority import make_realtime
from gateway.access.identity import Identity
from gateway.connections.acceptor import Acceptor
from gateway.connections.incoming_bytes import IncomingBytes, StopNow
from gateway.connections.listener_kind import Stream
from gateway.connections.rate_limit import RateLimit
from gateway.process.loop import Loop

Admit = Callable[[Stream, str, Identity], object]  # admits a client, with its address
Came = Callable[[socket.socket, Any], object]  # takes a new client, with its address

# Whether the peer is still there: asked by the kernel after 10 s of silence, given up after 15 s more.
_KEEPALIVE = {"TCP_KEEPIDLE": 10, "TCP_KEEPINTVL": 5, "TCP_KEEPCNT": 3, "TCP_USER_TIMEOUT": 25_000}


class Intake:
    """The accepting thread and its listeners. `opened` is called in the loop with each admitted client."""

    def __init__(
        self,
        loop: Loop,
        listeners: Mapping[socket.socket, Came],
        opened: Callable[[IncomingBytes], None],
        stop_now: Callable[[], StopNow | None],
    ) -> None:
        """`stop_now` returns the function that stops at once, from any thread, if there is one.

        `listeners` maps each listening socket to the function that takes its new clients, in the thread.
        """
        self._loop = loop
        self._front = Loop()
        self._opened = opened
        self._stop_now = stop_now
        self._inlets: set[IncomingBytes] = set()
        self._spent_ns = 0
        self._pace = RateLimit(self._front)
        self._acceptors = [
            Acceptor(self._front, one, partial(self._came, came)) for one, came in listeners.items()
        ]
        self._thread = threading.Thread(target=self._run, name="intake")

    def start(self) -> None:
        """Begin to accept."""
        for one in self._acceptors:
            one.start()
        self._thread.start()

    def admit(self, connection: Stream, peer: str, identity: Identity) -> None:
        """Admit a client; from any thread."""
        self._front.post(lambda: self._admit(connection, peer, identity))

    def listen(self, *, on: bool, then: Callable[[], object] = lambda: None) -> None:
        """Accept clients, or stop accepting; `then` runs in the loop after all accepted so far."""

        def change() -> None:
            for one in self._acceptors:
                (one.start if on else one.end)()
            self._front.post(lambda: self._loop.post(then))  # behind those who are being admitted

        self._front.post(change)

    def shut(self) -> None:
        """Stop accepting, and return once that is done."""
        shut = threading.Event()
        self._front.post(lambda: self._shut(shut))
        shut.wait()

    def end(self) -> None:
        """Close every connection, and join the thread; the listening sockets stay open."""
        self._front.post(self._finish)
        self._thread.join()
        self._front.close()

    def _run(self) -> None:
        make_realtime()
        self._front.run()

    def _shut(self, shut: threading.Event) -> None:
        for one in self._acceptors:
            one.end()
        shut.set()

    def _finish(self) -> None:
        for one in self._acceptors:
            one.end()
        for inlet in tuple(self._inlets):
            inlet.finish()
        self._front.stop()

    def _spent(self) -> int:
        """Return the thread's CPU time since the last call, in ns: the work for one client."""
        before_ns, self._spent_ns = self._spent_ns, time.thread_time_ns()
        return self._spent_ns - before_ns

    @staticmethod
    def _came(came: Came, connection: socket.socket, address: Any) -> None:
        _prepare(connection)
        came(connection, address)

    def _admit(self, connection: Stream, peer: str, identity: Identity) -> None:
        stop_now, spent, finished = self._stop_now, self._spent, self._inlets.discard
        inlet = IncomingBytes(
            self._front, self._loop, connection, peer, identity, stop_now, spent, finished, self._pace
        )
        self._inlets.add(inlet)
        self._loop.post(lambda: self._opened(inlet))


def _prepare(connection: socket.socket) -> None:
    connection.setblocking(False)
    # What waits in the kernel is old when it arrives: keep it short.
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 256 * 1024)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 128 * 1024)
    if connection.family == socket.AF_UNIX:
        return
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in _KEEPALIVE.items():
        option = getattr(socket, name, None)  # not every system has every one
        if option is not None:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)
