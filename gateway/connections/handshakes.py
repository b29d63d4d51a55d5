"""TLS handshakes, in a thread of their own: a few at once, each for a short time, address after address.

Who is known comes out of it as a stream with an identity; nobody else is answered anything but TLS.
"""

import contextlib
import logging
import socket
import ssl
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Final

from gateway.access.identity import Identity
from gateway.access.known_clients import Access
from gateway.certificates import KeyProblem, fingerprint
from gateway.connections.tls import TlsStream, context_of
from gateway.process.loop import READ, Loop, Timer
from gateway.wire.limits import HANDSHAKE_S, HANDSHAKES, HANDSHAKES_WAITING, HANDSHAKES_WAITING_OF_ONE_ADDRESS

log = logging.getLogger(__name__)

FRESH_S: Final = 0.3  # how long one keeps its place whoever waits
_HANDSHAKE: Final = 0x16  # the first byte of a ClientHello (RFC 8446 §5.1)
EXPIRY_WARNING_S: Final = 30 * 86_400

Admitted = Callable[[TlsStream, str, Identity], object]
Came = tuple[socket.socket, str]  # a connection, and whence


class Handshakes:
    """The thread. `take` and `end` may be called from others."""

    def __init__(
        self,
        access: Access,
        admitted: Admitted,
        complain: Callable[[str, str], object],
        finished: Callable[[], object],
    ) -> None:
        """All three are called in its thread. `finished` after each handshake, whatever became of it.

        Raises:
            KeyProblem: the robot's key cannot be used.

        """
        self._access = access
        self._admitted, self._complain, self._finished = admitted, complain, finished
        self._known = access.now()
        self._context = context_of(access.folder, self._known)
        self._loop = Loop()
        self._running: list[_Handshake] = []  # the oldest first
        self._waiting: dict[str, deque[Came]] = {}  # by address
        self._next: Timer | None = None
        self._taken = self._ended = 0  # each counted by one thread
        self._warned: set[str] = set()
        self._thread = threading.Thread(target=self._loop.run, name="handshakes")

    @property
    def busy(self) -> bool:
        """Whether somebody has come who is neither in nor gone yet."""
        return self._taken != self._ended

    def start(self) -> None:
        self._thread.start()

    def end(self) -> None:
        """Close what is under way, and join the thread."""
        self._loop.post(self._finish)
        self._thread.join()
        self._loop.close()

    def take(self, connection: socket.socket, peer: str) -> None:
        """Let somebody who has come prove who they are. Called by one thread."""
        self._taken += 1
        self._loop.post(lambda: self._came(connection, peer))

    # In its thread.

    def _finish(self) -> None:
        for handshake in tuple(self._running):
            handshake.give_up("the gateway ends")
        for came in self._waiting.values():
            for connection, _peer in came:
                connection.close()
        self._waiting.clear()
        self._loop.stop()

    def _came(self, connection: socket.socket, peer: str) -> None:
        address = peer.rpartition(":")[0]
        waiting = self._waiting.get(address, ())
        all_waiting = sum(map(len, self._waiting.values()))
        full = all_waiting >= HANDSHAKES_WAITING and not self._drop_silent()
        if full or len(waiting) >= HANDSHAKES_WAITING_OF_ONE_ADDRESS:
            connection.close()
            self._complain(address, "begins more handshakes than are done")
            self._end_one()
            return
        self._waiting.setdefault(address, deque()).append((connection, peer))
        self._settle()

    def _settle(self) -> None:
        """Begin those for whom there is room, one of each address after the other; who speaks comes first."""
        while self._waiting:
            speaks = next((one for one, came in self._waiting.items() if not _is_silent(came[0][0])), None)
            if len(self._running) >= HANDSHAKES and not self._make_room(speaks=speaks is not None):
                return
            address = speaks or next(iter(self._waiting))
            came = self._waiting.pop(address)
            connection, peer = came.popleft()
            if came:
                self._waiting[address] = came  # behind the others
            self._look()
            self._running.append(_Handshake(self, self._loop, connection, peer, self._context))

    def _drop_silent(self) -> bool:
        """Drop one silent connection of those that wait; return false if there is none."""
        for address, came in self._waiting.items():
            if _is_silent(came[0][0]):
                came.popleft()[0].close()
                if not came:
                    del self._waiting[address]
                self._end_one()
                return True
        return False

    def _make_room(self, *, speaks: bool) -> bool:
        """Drop the oldest of the address with most under way, unless it has just begun.

        To who `speaks`, one that has said nothing gives it up at once: silence costs an attacker nothing.
        """
        silent = next((one for one in self._running if one.is_silent), None) if speaks else None
        if silent is not None:
            silent.give_up("others wait")
            return True
        addresses = [one.address for one in self._running]
        greediest = max(addresses, key=addresses.count)
        oldest = next(one for one in self._running if one.address == greediest)
        left_s = FRESH_S - oldest.age_s
        if left_s <= 0:
            oldest.give_up("others wait")
            return True
        if self._next is None:
            self._next = self._loop.call_later(left_s, self._settle_later)
        return False

    def _settle_later(self) -> None:
        self._next = None
        self._settle()

    def _look(self) -> None:
        """Look for changed clients or roles; they count from now on."""
        known = self._access.now()
        if known is self._known:
            return
        self._known = known  # whom it lacks is not let in any more, whatever becomes of the rest
        try:
            self._context = context_of(self._access.folder, known)
        except KeyProblem as error:
            log.error("%s", error)

    def is_over(self, handshake: "_Handshake") -> None:
        """Note that it has ended, in whatever way."""
        self._running.remove(handshake)
        self._end_one()
        self._loop.post(self._settle)

    def _end_one(self) -> None:
        self._ended += 1
        self._finished()

    def admit(self, stream: TlsStream, peer: str) -> None:
        """Let in whoever has proved to be known; whom another's certificate vouches for is nobody."""
        der = stream.certificate
        identity = self._known.by_key.get(fingerprint(der)) if der else None
        if identity is None:
            stream.close()
            self._complain(peer.rpartition(":")[0], "has a key that nobody here knows")
            return
        self._warn_of_expiry(identity, stream.ends)
        self._admitted(stream, peer, identity)

    def fail(self, peer: str, why: str) -> None:
        self._complain(peer.rpartition(":")[0], why)

    def _warn_of_expiry(self, identity: Identity, ends: str) -> None:
        """Once a start; nobody is kept out for it, nor for a date that is none."""
        name = identity.name or ""
        with contextlib.suppress(ValueError):
            if name not in self._warned and ssl.cert_time_to_seconds(ends) - time.time() < EXPIRY_WARNING_S:
                self._warned.add(name)
                log.warning("the certificate of %s is only for the time until %s: pair it anew", name, ends)


class _Handshake:
    """One connection, from its first byte on; it belongs to the thread."""

    def __init__(
        self, owner: Handshakes, loop: Loop, connection: socket.socket, peer: str, context: ssl.SSLContext
    ) -> None:
        self.address = peer.rpartition(":")[0]
        self._owner, self._loop = owner, loop
        self._socket = connection
        self._stream: TlsStream | None = None  # from its first byte on
        self._peer, self._context = peer, context
        self._began_s = time.monotonic()
        self._late = loop.call_later(HANDSHAKE_S, lambda: self.give_up("does not end its handshake"))
        connection.setblocking(False)
        loop.watch(connection, READ, self._on_ready)

    @property
    def age_s(self) -> float:
        return time.monotonic() - self._began_s

    @property
    def is_silent(self) -> bool:
        """Whether it has said nothing yet."""
        return self._stream is None and _is_silent(self._socket)

    def give_up(self, why: str) -> None:
        self._leave()
        self._socket.close()
        self._owner.fail(self._peer, why)
        self._owner.is_over(self)

    def _leave(self) -> None:
        self._late.cancel()
        self._loop.watch(self._socket, 0, self._on_ready)

    def _on_ready(self, _events: int) -> None:
        try:
            stream = self._stream or self._begun()
            if stream is None:
                self.give_up("speaks another protocol, or no TLS: it has not been paired")
                return
            stream.handshake()
        except BlockingIOError:
            return
        except OSError as error:
            self.give_up(f"is not let in: {_reason(error)}")
            return
        self._leave()
        try:
            self._owner.admit(stream, self._peer)
        finally:  # whatever becomes of it, its place is free
            self._owner.is_over(self)

    def _begun(self) -> TlsStream | None:
        """Begin by the first byte: what is no TLS is not even told an alert."""
        first = self._socket.recv(1, socket.MSG_PEEK)
        if first and first[0] == _HANDSHAKE:
            self._stream = TlsStream(self._socket, self._context)
        return self._stream


def _is_silent(connection: socket.socket) -> bool:
    try:
        connection.recv(1, socket.MSG_PEEK)
    except BlockingIOError:
        return True
    except OSError:
        pass  # it has gone, which is to be seen too
    return False


def _reason(error: OSError) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return "its key is not known here"
    return (error.reason if isinstance(error, ssl.SSLError) else error.strerror) or "it has gone"
