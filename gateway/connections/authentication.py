"""Authentication of clients: TLS with a key, loopback without one, accounts on the robot."""

import contextlib
import logging
import socket
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.access.folder import AccessFolder
from gateway.access.identity import ANYBODY, Identity
from gateway.certificates import KeyProblem
from gateway.connections.intake import Admit, Came
from gateway.connections.listener_kind import ListenerKind, Stream, has_keys_at_start, kind_of
from gateway.wire import framing

if TYPE_CHECKING:
    from gateway.access.identity import Peer
    from gateway.access.known_clients import Access, KnownClients
    from gateway.connections.accounts import Accounts
    from gateway.connections.handshakes import Handshakes

log = logging.getLogger(__name__)

STRANGER = "is a user whom this robot does not know"


class Authentication:
    """Authentication at the listeners of one gateway. Code for keys is imported only if needed."""

    def __init__(
        self,
        listeners: Iterable[socket.socket],
        folder: AccessFolder,
        complain: Callable[[str, str], object],
        finished: Callable[[], object],
        *,
        robot: Path,
        rested_without_keys: bool = False,
        needs_key: bool = True,
    ) -> None:
        """`complain` of an address, and `finished` after each handshake, are called in any thread.

        `robot` is the robot's file, for messages. Where it does not need its key, and cannot use it, whoever
        comes with one is sent away, and this computer's accounts are let in.

        Raises:
            UnsafeListener: one of these sockets must not be served.
            KeyProblem: the robot's key is needed and cannot be used.

        """
        self._complain = complain
        self._folder = folder
        self._finished = finished
        self._people: Access | None = None
        self._accounts: Accounts | None = None
        self._admit: Admit = _nobody
        self.has_keys = has_keys_at_start(now=folder.has_keys, rested_without=rested_without_keys)
        kinds = {one: kind_of(one, has_keys=self.has_keys, robot=robot) for one in listeners}
        self._handshakes: Handshakes | None = None
        if ListenerKind.TLS in kinds.values():
            with contextlib.suppress(*(() if needs_key else (KeyProblem,))):
                self._handshakes = self._made(finished)
        came = {
            ListenerKind.PLAIN: self._came_plainly,
            ListenerKind.TLS: self._came_for_tls,
            ListenerKind.UNIX: self._came_locally,
        }
        self.listeners: Mapping[socket.socket, Came] = {one: came[kind] for one, kind in kinds.items()}

    def _made(self, finished: Callable[[], object]) -> "Handshakes":
        from gateway.connections.handshakes import Handshakes

        return Handshakes(self._access, self._let_in, self._complain, finished)

    def start(self, admit: Admit) -> None:
        """Start; `admit` is called with every admitted client."""
        self._admit = admit
        if self._handshakes is not None:
            self._handshakes.start()

    def end(self) -> None:
        """Join the threads that were started."""
        if self._accounts is not None:
            self._accounts.end()
        if self._handshakes is not None:
            self._handshakes.end()

    @property
    def busy(self) -> bool:
        """Whether a client is being authenticated."""
        parts = (self._handshakes, self._accounts)
        return any(part is not None and part.busy for part in parts)

    def known(self) -> "KnownClients":
        """Return all clients that the files admit now."""
        return self._access.now()

    @property
    def _asked_for(self) -> "Accounts":
        """The accounts of local clients; for the thread that accepts."""
        if self._accounts is None:
            from gateway.connections.accounts import Accounts

            self._accounts = Accounts(self._finished)
        return self._accounts

    @property
    def _access(self) -> "Access":
        if self._people is None:
            from gateway.access.known_clients import Access

            self._people = Access(self._folder)
        return self._people

    def _let_in(self, stream: Stream, peer: str, identity: Identity) -> None:
        self._admit(stream, peer, identity)

    # In the thread that accepts.

    def _came_plainly(self, connection: socket.socket, address: Any) -> None:
        self._admit(connection, _peer(address), ANYBODY)

    def _came_for_tls(self, connection: socket.socket, address: Any) -> None:
        if self._handshakes is None:
            connection.close()
        else:
            self._handshakes.take(connection, _peer(address))

    def _came_locally(self, connection: socket.socket, _address: Any) -> None:
        from gateway.access.users import peer_of

        peer, _ = peer_of(connection), self._access  # made by one thread
        if not self._asked_for.take(peer, lambda named: self._decide(connection, named)):
            connection.close()
            self._complain(f"uid {peer.uid}", "comes while too many others are asked for")

    def _decide(self, connection: socket.socket, peer: "Peer") -> None:
        """In a thread of its own."""
        from gateway.access.users import identity_of

        identity = identity_of(peer, self.known().table)
        if identity is None:
            self._refuse(connection, f"uid {peer.uid}")
        else:
            self._admit(connection, f"uid {peer.uid}:{connection.fileno()}", identity)

    def _refuse(self, connection: socket.socket, whom: str) -> None:
        """Refuse an unlisted user of the robot, with a message."""
        why = f"{whom} {STRANGER}: [users] or [groups] of {self._folder.table} may name it"
        line = framing.encode_error(None, framing.refuse(framing.ErrorKind.NOT_ALLOWED, why))
        with connection:
            try:
                connection.send(line)
            except OSError as error:
                log.info("%s: %s", whom, error)
        self._complain(whom, STRANGER)


def _peer(address: Any) -> str:
    return f"{address[0]}:{address[1]}"


def _nobody(stream: Stream, _peer: str, _identity: Identity) -> None:
    stream.close()
