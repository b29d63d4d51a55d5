"""The on-demand TCP server: accepts clients and serves them in one loop until it is told to end."""

import contextlib
import errno
import logging
import selectors
import signal
import socket
from collections.abc import Callable, Iterator, Mapping
from types import FrameType

from gateway import wire
from gateway.config import RobotConfig
from gateway.loop import Loop
from gateway.registry import MODULES, Spec
from gateway.service import Service
from gateway.session import Session

log = logging.getLogger(__name__)

MAX_SESSIONS = 64
BACKLOG = 32
REST_S = 1.0  # how long nobody new is accepted when the process has no descriptors left


class Daemon:
    """One robot's gateway on one listening socket."""

    def __init__(
        self, config: RobotConfig, listener: socket.socket, specs: Mapping[str, Spec] = MODULES
    ) -> None:
        self._listener = listener
        self._loop = Loop()
        self._service = Service(config, self._loop, specs)
        self._sessions: set[Session] = set()
        self._ending = False
        listener.setblocking(False)

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that clients connect to."""
        host, port = self._listener.getsockname()[:2]
        return host, port

    def run(self, ready: Callable[[], object] = lambda: None) -> None:
        """Serve until `end`; `ready` is called once when clients can connect."""
        self._listen()
        self._loop.post(self._service.resume)
        self._loop.post(ready)
        try:
            self._loop.run()
        finally:
            self._listener.close()
            self._loop.close()

    def end(self) -> None:
        """Close every client, stop every module, and let `run` return; from any thread or signal handler.

        Where a guard has armed the drives it is refused, in the log and the journal, while one is enabled.
        """
        self._loop.post(self._end)

    def end_on_signals(self) -> "contextlib.AbstractContextManager[None]":
        """While inside, SIGINT and SIGTERM end the daemon. For the main thread only."""
        return _signals(self._loop.wake_writer, self.end)

    def _listen(self) -> None:
        if not self._ending:
            self._loop.watch(self._listener, selectors.EVENT_READ, lambda _events: self._accept())

    def _accept(self) -> None:
        try:
            connection, address = self._listener.accept()
        except BlockingIOError:
            return
        except OSError as error:
            log.warning("a client could not be accepted: %s", error)
            if error.errno in (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM):
                self._loop.watch(self._listener, 0, lambda _events: None)
                self._loop.call_later(REST_S, self._listen)
            return
        try:
            self._open(connection, f"{address[0]}:{address[1]}")
        except OSError as error:  # it has gone already
            log.info("%s: %s", address, error)
            connection.close()

    def _open(self, connection: socket.socket, peer: str) -> None:
        session = Session(self._loop, connection, peer, self._service.handle)
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
        self._loop.watch(self._listener, 0, lambda _events: None)
        for session in tuple(self._sessions):
            session.close()
        self._service.registry.close(self._loop.stop)


def listen(host: str, port: int) -> socket.socket:
    """A listening TCP socket; port 0 picks one.

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
            error.errno, f"cannot listen on {host}:{port}: {reason}; choose another with --host or --port"
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
