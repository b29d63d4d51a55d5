"""The on-demand TCP server: accepts clients and serves them in one loop until it is told to end."""

import contextlib
import logging
import signal
import socket
from collections.abc import Callable, Iterator, Mapping
from types import FrameType
from typing import Any

from gateway import wire
from gateway.acceptor import Acceptor
from gateway.classic import ClassicPort
from gateway.config import RobotConfig
from gateway.loop import Loop
from gateway.registry import MODULES, Spec
from gateway.service import Service
from gateway.session import Session

log = logging.getLogger(__name__)

MAX_SESSIONS = 64
BACKLOG = 32


class Daemon:
    """One robot's gateway on one listening socket."""

    def __init__(
        self, config: RobotConfig, listener: socket.socket, specs: Mapping[str, Spec] = MODULES
    ) -> None:
        classic_port = config.gateway.classic_port
        classic = None if classic_port is None else listen(config.gateway.host, classic_port, "classic_port")
        self._listener = listener
        self._loop = Loop()
        self._service = Service(config, self._loop, specs)
        self._sessions: set[Session] = set()
        self._ending = False
        self._acceptor = Acceptor(self._loop, listener, self._open)
        self._classic: ClassicPort | None = None
        if classic is not None:
            self._classic = ClassicPort(self._loop, classic, self._service.registry)

    @property
    def classic_port(self) -> int | None:
        """Where the paper's own exchange is served, if at all."""
        return None if self._classic is None else self._classic.port

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that clients connect to."""
        host, port = self._listener.getsockname()[:2]
        return host, port

    def run(self, ready: Callable[[], object] = lambda: None) -> None:
        """Serve until `end`; `ready` is called once when clients can connect."""
        self._acceptor.start()
        self._loop.post(self._service.resume)
        self._loop.post(ready)
        try:
            self._loop.run()
        finally:
            self._listener.close()
            if self._classic is not None:
                self._classic.close()
            self._loop.close()

    def end(self) -> None:
        """Close every client, stop every module, and let `run` return; from any thread or signal handler.

        Where a guard has armed the drives it is refused, in the log and the journal, while one is enabled.
        """
        self._loop.post(self._end)

    def end_on_signals(self) -> "contextlib.AbstractContextManager[None]":
        """While inside, SIGINT and SIGTERM end the daemon. For the main thread only."""
        return _signals(self._loop.wake_writer, self.end)

    def _open(self, connection: socket.socket, address: Any) -> None:
        session = Session(self._loop, connection, f"{address[0]}:{address[1]}", self._service.handle)
        if len(self._sessions) >= MAX_SESSIONS:
            message = f"{MAX_SESSIONS} clients are connected, which is the most; end one of them"
            session.send(wire.encode_error(None, wire.refuse(wire.Kind.UNAVAILABLE, message)))
            session.close()
            return
        self._sessions.add(session)
        session.on_close(lambda: self._sessions.discard(session))
        self._service.opened(session)

    def _end(self) -> None:
        if self._ending:
            return
        objection = self._service.objection()
        if objection is not None:
            log.error("%s", objection)
            return
        self._ending = True
        self._acceptor.end()
        for session in tuple(self._sessions):
            session.close()
        self._service.registry.close(self._loop.stop)


def listen(host: str, port: int, setting: str = "--host or --port") -> socket.socket:
    """A listening TCP socket; port 0 picks one. `setting` is what an error tells to change.

    Raises:
        OSError: the address is not ours, or the port is in use; the message names both.

    """
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        return socket.create_server(address[:2], family=family, backlog=BACKLOG)
    except OSError as error:
        reason = error.strerror or str(error)
        raise OSError(
            error.errno, f"cannot listen on {host}:{port}: {reason}; choose another with {setting}"
        ) from error


@contextlib.contextmanager
def _signals(wake_writer: int, end: Callable[[], None]) -> Iterator[None]:
    def on_signal(_number: int, _frame: FrameType | None) -> None:
        end()

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    woken = signal.set_wakeup_fd(wake_writer, warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(woken)
        for number, handler in before.items():
            signal.signal(number, handler)
