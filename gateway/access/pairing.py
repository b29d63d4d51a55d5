"""The robot's side of pairing: shows a code, and lets one desk in that proves to know it."""

import contextlib
import queue
import socket
import ssl
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import msgspec

from gateway.access.folder import AccessFolder
from gateway.certificates import KeyProblem, der_of, fingerprint
from gateway.wire.pairing import DESK, LINE_BYTES, ROBOT, SAY_S, TRIES, VALID_S, Offer, Reply, proof, proves

_AT_ONCE: Final = 8  # connections that may still say something
_LOOK_S: Final = 0.2  # between looks whether the time is over


class PairingEnded(Exception):
    """Nobody was paired; says why."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A desk that has proved the code, and waits: `answer` once, and it is gone."""

    name: str
    der: bytes
    connection: ssl.SSLSocket

    @property
    def fingerprint(self) -> str:
        return fingerprint(self.der)

    def check_waits(self) -> None:
        """Raise `PairingEnded` where it has gone: it would never know that it was let in."""
        self.connection.settimeout(0)
        try:
            gone = not self.connection.recv(1)
        except ssl.SSLWantReadError:
            gone = False
        except OSError:
            gone = True
        self.connection.settimeout(VALID_S)
        if gone:
            raise PairingEnded("the desk has gone meanwhile, and was not let in; begin again with a new code")

    def answer(self, reply: Reply) -> None:
        with self.connection, contextlib.suppress(OSError):
            self.connection.sendall(msgspec.json.encode(reply) + b"\n")


@dataclass(frozen=True, slots=True)
class _Visitor:
    """Somebody who has come, and may still say something, in a thread."""

    address: str
    connection: socket.socket  # a second handle: TLS takes the first one over
    thread: threading.Thread

    def send_away(self) -> None:
        """Its thread ends at once."""
        with contextlib.suppress(OSError):
            self.connection.shutdown(socket.SHUT_RDWR)
        self.see_out()

    def see_out(self) -> None:
        """Wait for its thread."""
        self.thread.join()
        self.connection.close()


class Pairing:
    """One code's life, on a listening socket: `wait` for a desk, within it."""

    def __init__(
        self,
        folder: AccessFolder,
        listener: socket.socket,
        code: str,
        own: str,
        valid_s: float = VALID_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`own` is the robot's fingerprint. Raises `KeyProblem`: its key cannot be used."""
        self._listener = listener
        self._code, self._own = code, own
        self._clock = clock
        self._until_s = clock() + valid_s
        self._tries = TRIES
        self._lock = threading.Lock()
        self._proved: queue.Queue[Candidate] = queue.Queue()
        self._winner: threading.Thread | None = None  # of the desk that has used the code up
        self._context = _context(folder)

    def wait(self) -> Candidate:
        """Return the desk that proves the code first.

        Raises:
            PairingEnded: the time is over, or the code was guessed at too often.

        """
        self._listener.settimeout(_LOOK_S)
        visitors: list[_Visitor] = []  # the oldest first
        try:
            while True:
                with contextlib.suppress(queue.Empty):
                    return self._proved.get_nowait()
                self._check()
                for one in [one for one in visitors if not one.thread.is_alive()]:
                    visitors.remove(one)
                    one.see_out()
                with contextlib.suppress(TimeoutError):
                    self._accept(visitors)
        finally:
            for one in visitors:
                one.thread.join(_LOOK_S)  # whoever is being judged is told
                (one.see_out if one.thread is self._winner else one.send_away)()

    def proof(self, candidate: Candidate) -> str:
        """Return the robot's own, for the reply."""
        return proof(ROBOT, self._code, self._own, candidate.fingerprint)

    def _check(self) -> None:
        if self._tries <= 0:
            raise PairingEnded(f"{TRIES} wrong codes came: this one is void; begin again with a new one")
        if self._clock() >= self._until_s:
            raise PairingEnded("nobody came in time: the code is void; begin again with a new one")

    def _accept(self, visitors: list[_Visitor]) -> None:
        """Accept one more; if too many wait, the oldest of the address with the most makes room."""
        connection, address = self._listener.accept()
        if len(visitors) >= _AT_ONCE:
            others = [one for one in visitors if one.thread is not self._winner]
            addresses = [one.address for one in others]
            greediest = max(addresses, key=addresses.count)
            oldest = next(one for one in others if one.address == greediest)
            visitors.remove(oldest)
            oldest.send_away()
        thread = threading.Thread(target=self._hear, args=(connection,), name="pairing")
        visitors.append(_Visitor(str(address[0]), connection.dup(), thread))
        thread.start()

    # In a thread a connection.

    def _hear(self, connection: socket.socket) -> None:
        connection.settimeout(SAY_S)
        try:
            secured = self._context.wrap_socket(connection, server_side=True)
        except OSError:
            connection.close()
            return
        try:
            offer = msgspec.json.decode(_line(secured), type=Offer)
            der = der_of(offer.certificate.encode("ascii", "replace"))
        except (OSError, KeyProblem, msgspec.MsgspecError):
            secured.close()
            return
        problem = self._judged(offer, der)
        candidate = Candidate(offer.name, der, secured)
        if problem is None:
            secured.settimeout(VALID_S)
            self._proved.put(candidate)
        else:
            candidate.answer(Reply(problem=problem))

    def _judged(self, offer: Offer, der: bytes) -> str | None:
        """One proof at a time, so that no number of them at once is more than the tries."""
        with self._lock:
            if self._winner is not None:
                return "another desk has used this code: it is for one"
            if self._tries <= 0 or self._clock() >= self._until_s:
                return "this code is void: begin again on the robot"
            if not proves(offer.proof, DESK, self._code, self._own, fingerprint(der)):
                self._tries -= 1
                return "that is not the code which the robot shows, or somebody is in between"
            self._winner = threading.current_thread()
            return None


def _line(secured: ssl.SSLSocket) -> bytes:
    """Return the first line; raises `OSError` where it does not come in time, or is too long."""
    until_s, found = time.monotonic() + SAY_S, b""
    while b"\n" not in found:
        left_s = until_s - time.monotonic()
        if left_s <= 0 or len(found) > LINE_BYTES:
            raise TimeoutError("no line came")
        secured.settimeout(left_s)
        more = secured.recv(LINE_BYTES)
        if not more:
            raise ConnectionError("it has gone")
        found += more
    return found.partition(b"\n")[0]


def _context(folder: AccessFolder) -> ssl.SSLContext:
    """Return the robot's key; of the desk nothing is asked but its proof."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.num_tickets = 0
    try:
        context.load_cert_chain(folder.certificate, folder.key)
    except (OSError, ValueError) as error:
        raise KeyProblem(f"the robot's key in {folder.keys} cannot be used: {error}") from None
    return context
