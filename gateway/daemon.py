"""The on-demand TCP server: serves its clients in one loop until it is told to end, or idle."""

import contextlib
import logging
import signal
import socket
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from gateway.access.folder import AccessFolder
from gateway.access.identity import ANYBODY
from gateway.config.robot import RobotConfig
from gateway.connections.authentication import Authentication
from gateway.connections.classic import ClassicPort
from gateway.connections.connection_slots import ConnectionSlots
from gateway.connections.fair_share import FairShare
from gateway.connections.incoming_bytes import IncomingBytes
from gateway.connections.intake import Intake
from gateway.connections.listener_kind import check_classic, said
from gateway.connections.session import Session
from gateway.process.loop import Loop, Timer
from gateway.process.resting import ENDING
from gateway.registry import MODULES, Spec
from gateway.service import Service
from gateway.wire import framing

if TYPE_CHECKING:
    from gateway.access.known_clients import KnownClients

log = logging.getLogger(__name__)

MUCH_BYTES = 64 * 1024  # that a client has sent or got
TIDY_S = 5.0  # after it has gone
WATCH_S = 0.2  # between looks whether those who are connected are still known
REREAD_S = 0.2  # after who was refused for the robot's file: the next one is to find it mended
STOP_ALONE = "only a stop is carried out until that is mended and the gateway is started again"

_REVOKED = framing.refuse(
    framing.ErrorKind.NOT_ALLOWED, "what you may do on this robot has changed, so this connection ends"
)


class Daemon:
    """One robot's gateway on one listening socket."""

    def __init__(
        self,
        config: RobotConfig,
        listener: socket.socket,
        specs: Mapping[str, Spec] = MODULES,
        classic: socket.socket | None = None,
        local: socket.socket | None = None,
        *,
        ends_idle: bool = False,
        rested_without_keys: bool = False,
    ) -> None:
        """`classic` is where the paper's own exchange is served, `local` a Unix socket.

        With `ends_idle`, `run` returns too when nobody has needed the gateway for its `linger_s`. Where
        it has `rested_without_keys`, it is served without them again. Where the robot's file is `outdated`,
        everything but a stop is answered with that, `classic` is not served, and without a key that can be
        used nobody at the network is.

        Raises:
            UnsafeListener: one of these sockets must not be served.
            KeyProblem: the robot's key cannot be used.

        """
        self._config = config
        self._listener = listener
        self._loop = Loop()
        self._service = Service(config, self._loop, specs)
        self._service.registry.when_off = self._look_whether_idle
        self._service.listens = said(listener.getsockname())
        self._places = ConnectionSlots()
        self._sharing = FairShare(self._loop)
        self._ending = False
        self._told = False
        self._tidying = False
        self._ends_idle = ends_idle
        self._refusal = _only_a_stop(config.outdated) if config.outdated else None
        self._idle: Timer | None = None
        self._sockets = [listener] if local is None else [listener, local]
        folder = AccessFolder(config.access)
        self._authentication = Authentication(
            self._sockets,
            folder,
            self._complain,
            lambda: self._loop.post(self._left),
            robot=config.path,
            rested_without_keys=rested_without_keys,
            needs_key=not config.outdated,
        )
        self._known: KnownClients | None = None  # at the last look, while a client is authenticated
        listeners, registry = self._authentication.listeners, self._service.registry
        self._intake = Intake(self._loop, listeners, self._open, lambda: registry.stop_now)
        self._classic: ClassicPort | None = None
        if classic is not None:
            check_classic(classic)
            self._classic = ClassicPort(
                self._loop,
                classic,
                self._service.use_resource,
                self._service.registry.leave,
                self._left,
                is_served=self._refusal is None,
            )

    @property
    def classic_port(self) -> int | None:
        """Where the paper's own exchange is served, if at all."""
        return None if self._classic is None else self._classic.port

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that clients connect to."""
        host, port = self._listener.getsockname()[:2]
        return host, port

    @property
    def has_keys(self) -> bool:
        """Whether it is served with them."""
        return self._authentication.has_keys

    @property
    def told(self) -> bool:
        """Whether it was told to end."""
        return self._told

    def run(self, ready: Callable[[], object] = lambda: None) -> None:
        """Serve until `end`, then close the listening sockets; `ready` is called when clients can connect.

        Where it has ended because it was idle, the sockets stay open: somebody may just be coming.
        """
        self._authentication.start(self._intake.admit)
        self._intake.start()
        self._loop.post(self._service.resume)
        self._loop.post(ready)
        self._loop.post(self._left)
        try:
            self._loop.run()
        finally:
            self._intake.shut()  # nobody comes to the entrance any more …
            self._authentication.end()  # … and nobody from there to the intake
            self._intake.end()
            self._service.close()
            if self._told:
                self._give_back()
            if self._classic is not None:
                self._classic.close(given_back=self._told)
            self._loop.close()

    def repeat(self, period_s: float, work: Callable[[], object]) -> None:
        """Call `work` once a period, for as long as the loop turns."""

        def again() -> None:
            work()
            self._loop.call_later(period_s, again)

        self._loop.post(again)

    def end(self) -> None:
        """Close every client, stop every module, and let `run` return; from any thread or signal handler.

        Where a guard has armed the drives it is refused, in the log and the journal, while one is enabled.
        """
        self._told = True
        self._loop.post(self._end)

    def end_on_signals(self) -> "contextlib.AbstractContextManager[None]":
        """Let SIGINT and SIGTERM end the daemon within the block. For the main thread only."""
        return _signals(self._loop.wake_writer, self.end)

    def _open(self, inlet: IncomingBytes) -> None:
        if self._ending:
            inlet.close()
            return

        def session(refusal: framing.RpcError | None) -> Session:
            wait_s, told = self._config.gateway.stuck_s, refusal or self._refusal
            return Session(self._loop, inlet, self._service.handle, wait_s, self._sharing, told)

        address = inlet.peer.rpartition(":")[0]
        opened = self._places.admit(address, session)
        if opened is None:
            self._sharing.complain(address, "has taken all the places that it may have")
        else:
            opened.on_close(self._left)
            opened.on_close(lambda: self._tidy_after(opened))
            self._service.opened(opened)
            self._watch_over(opened)

    def _give_back(self) -> None:
        for one in self._sockets:
            if one.family == socket.AF_UNIX:
                with contextlib.suppress(OSError):
                    Path(one.getsockname()).unlink()
            one.close()

    def _complain(self, address: str, what: str) -> None:
        """From any thread."""
        self._loop.post(lambda: self._sharing.complain(address, what))

    def _watch_over(self, session: Session) -> None:
        """Close a client of a key or account as soon as that is taken away."""
        if session.identity is ANYBODY:
            return
        known = self._authentication.known()
        if not known.knows(session.identity):
            session.close(_REVOKED)
        elif self._known is None:
            self._known = known
            self._service.who_is_known(known)
            self._loop.call_later(WATCH_S, self._look_who_is_known)

    def _look_who_is_known(self) -> None:
        by_name = [one for one in self._places.taken if one.identity is not ANYBODY]
        if not by_name:
            self._known = None
            return
        before, known = self._known, self._authentication.known()
        if known is not before:
            self._service.who_is_known(known)
        for session in by_name if known is not before else ():
            if not known.knows(session.identity):
                session.close(_REVOKED)
        self._known = known
        self._loop.call_later(WATCH_S, self._look_who_is_known)

    def _tidy_after(self, gone: Session) -> None:
        """Give memory back to the system soon after a client that moved much has gone."""
        if gone.received_bytes + gone.sent_bytes >= MUCH_BYTES and not self._tidying:
            self._tidying = True
            self._loop.call_later(TIDY_S, self._tidy)

    def _tidy(self) -> None:
        from gateway.process.memory import MemoryLock  # for a gateway that has worked

        self._tidying = False
        MemoryLock.give_back()

    def _left(self) -> None:
        """Note that nobody is left, or has come yet: `linger_s` from now it may be idle."""
        if self._idle is not None:
            self._idle.cancel()
        if self._ends_idle:
            linger_s = self._config.gateway.linger_s
            wait_s = linger_s if self._refusal is None else min(linger_s, REREAD_S)
            self._idle = self._loop.call_later(wait_s, self._lingered)

    def _lingered(self) -> None:
        self._idle = None
        self._look_whether_idle()

    @property
    def _is_idle(self) -> bool:
        """Nobody is there, nothing runs, and nothing is left that must."""
        if not self._ends_idle or self._ending or self._idle is not None or self._places.taken:
            return False
        return not (self._authentication.busy or self._service.needed) and not (
            self._classic is not None and self._classic.busy
        )

    def _look_whether_idle(self) -> None:
        """End where it is idle; before that nobody more is accepted, because whoever was is to be served."""
        if self._is_idle:
            self._intake.listen(on=False, then=self._end_idle)

    def _end_idle(self) -> None:
        if self._is_idle:
            self._loop.stop()
        elif not self._ending:
            self._intake.listen(on=True)

    def _end(self) -> None:
        if self._ending:
            return
        objection = self._service.objection()
        if objection is not None:
            log.error("%s", objection)
            return
        self._ending = True
        self._intake.listen(on=False)
        for session in self._places.taken:
            session.close()
        self._service.registry.close(self._loop.stop)


def _only_a_stop(why: str) -> framing.RpcError:
    return framing.refuse(framing.ErrorKind.UNAVAILABLE, f"{why}; {STOP_ALONE}")


@contextlib.contextmanager
def _signals(wake_writer: int, end: Callable[[], None]) -> Iterator[None]:
    def on_signal(_number: int, _frame: FrameType | None) -> None:
        end()

    before = {number: signal.signal(number, on_signal) for number in ENDING}
    woken = signal.set_wakeup_fd(wake_writer, warn_on_full_buffer=False)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)  # where it was woken, they have waited
    try:
        yield
    finally:
        signal.set_wakeup_fd(woken)
        for number, handler in before.items():
            signal.signal(number, handler)
