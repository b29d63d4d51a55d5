"""A network between a client and a server that is slow, and can be cut: a TCP relay, a thread each way."""

import contextlib
import socket
import threading
from collections.abc import Callable
from typing import Self


class SlowNetwork:
    """Relays every connection to a port of this computer, each piece later by `delay_s`."""

    def __init__(self, target: int, delay_s: float, port: int = 0) -> None:
        self.delay_s = delay_s
        self.carried = 0  # bytes, both ways
        self._target = target
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port: int = self._listener.getsockname()[1]
        self._lock = threading.Lock()
        self._sockets: list[socket.socket] = []  # closed at the end, when no thread uses them any more
        self._threads: list[threading.Thread] = []
        self._gone = threading.Event()

    def __enter__(self) -> Self:
        self._start(self._accept)
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Go away: every connection ends, and none is accepted any more. Idempotent."""
        self._gone.set()
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        while self._threads:
            self.cut()
            self._threads.pop(0).join()
        for each in (self._listener, *self._sockets):
            each.close()

    def cut(self) -> None:
        """End every connection that there is now."""
        with self._lock:
            _end(*self._sockets)

    def _start(self, work: Callable[..., None], *arguments: socket.socket) -> None:
        thread = threading.Thread(target=work, args=arguments, name="slow network")
        self._threads.append(thread)
        thread.start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):  # it has gone away
            while not self._gone.is_set():
                near, _ = self._listener.accept()
                self._connect(near)

    def _connect(self, near: socket.socket) -> None:
        try:
            far = socket.create_connection(("127.0.0.1", self._target))
        except OSError:
            near.close()
            return
        with self._lock:
            self._sockets += near, far
        self._start(self._carry, near, far)
        self._start(self._carry, far, near)

    def _carry(self, here: socket.socket, there: socket.socket) -> None:
        try:
            while piece := here.recv(65_536):
                self._gone.wait(self.delay_s)
                there.sendall(piece)
                with self._lock:
                    self.carried += len(piece)
            there.shutdown(socket.SHUT_WR)
        except OSError:
            _end(here, there)


def _end(*sockets: socket.socket) -> None:
    """No more either way; whoever waits for one of them is woken."""
    for each in sockets:
        with contextlib.suppress(OSError):
            each.shutdown(socket.SHUT_RDWR)
