"""TLS 1.3 on one connection, and what a robot says and asks for in it. Imported only where there are keys."""

import logging
import socket
import ssl
import stat
import threading
from typing import Final

from drivers.realtime_priority import lent_realtime
from gateway.access.folder import AccessFolder
from gateway.access.known_clients import KnownClients
from gateway.certificates import KeyProblem
from gateway.private import forbid_core_dumps

log = logging.getLogger(__name__)

RECORD: Final = 16 * 1024  # the most that one record holds (RFC 8446 §5.1)
NO_CHECK_TIME: Final = 0x20_0000  # X509_V_FLAG_NO_CHECK_TIME: a robot without a clock begins in 1970
# With the second a certificate is found as it is, and not by its subject, which two desks may share.
_VERIFY: Final = NO_CHECK_TIME | ssl.VerifyFlags.VERIFY_X509_PARTIAL_CHAIN
PIECE: Final = (
    4096  # of what has come, given to OpenSSL at once: in it are 150 KeyUpdates, which take a millisecond
)


class TlsStream:
    """Encrypts one socket; one thread reads it, and another one writes.

    OpenSSL never has the socket itself: it would read on by itself as long as records come that are for it
    alone (KeyUpdate), and whoever sends nothing else would have the thread. It is given a piece at a time.

    Who reads, and with it every stop, waits for nobody of less urgency: it lends who writes its own until
    that has written its record.
    """

    __slots__ = ("_come", "_goes", "_lock", "_rest", "_size", "_socket", "_tls", "_writer")

    def __init__(self, connection: socket.socket, context: ssl.SSLContext) -> None:
        self._socket = connection
        self._lock = threading.Lock()  # OpenSSL lets one thread at a time into a connection
        self._come, self._goes = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = context.wrap_bio(self._come, self._goes, server_side=True)
        self._rest, self._size = b"", 0  # of a record that is on its way, and what it holds
        self._writer = 0  # the thread that wrote last, if any

    def fileno(self) -> int:
        return self._socket.fileno()

    def handshake(self) -> None:
        """Go on with it; raises `BlockingIOError` until it has ended, `OSError` where it has failed."""
        self._take(PIECE)
        try:
            self._tls.do_handshake()
        except ssl.SSLWantReadError as error:
            raise BlockingIOError from error
        finally:
            if answer := self._goes.read():  # little, and the first that is sent: there is room
                self._socket.sendall(answer)

    @property
    def certificate(self) -> bytes | None:
        """The other side's (DER)."""
        return self._tls.getpeercert(binary_form=True)

    @property
    def ends(self) -> str:
        """Until when it is for, in OpenSSL's words; empty where it cannot be read."""
        try:
            return str((self._tls.getpeercert() or {}).get("notAfter", ""))
        except ValueError:  # something else in it cannot
            return ""

    def recv(self, most: int) -> bytes:
        """As of a socket: raises `BlockingIOError` where nothing has come."""
        self._lock_to_read()
        try:
            if not self._waiting:
                self._take(min(most, PIECE))
            return self._tls.read(most)
        except ssl.SSLWantReadError as error:
            raise BlockingIOError from error
        except ssl.SSLEOFError:
            return b""
        finally:
            self._lock.release()

    def pending(self) -> int:
        """Return bytes that have come already, and of which no poll tells."""
        self._lock_to_read()
        try:
            return self._waiting
        finally:
            self._lock.release()

    @property
    def _waiting(self) -> int:
        return self._come.pending + self._tls.pending()

    def _take(self, most: int) -> None:
        if data := self._socket.recv(most):
            self._come.write(data)
        else:
            self._come.write_eof()

    def send(self, data: bytes | memoryview) -> int:
        """Return a record at most, so that whoever reads waits no longer than for that.

        Raises `BlockingIOError` until all of it has gone: the same is to be sent again until then.
        """
        with self._lock:
            self._writer = threading.get_native_id()
            if not self._rest:
                self._size = self._tls.write(data[:RECORD])
                self._rest = self._goes.read()
            self._rest = self._rest[self._socket.send(self._rest) :]
            if self._rest:
                raise BlockingIOError
            return self._size

    def close(self) -> None:
        self._socket.close()

    def _lock_to_read(self) -> None:
        if not self._lock.acquire(blocking=False):
            with lent_realtime(self._writer):
                self._lock.acquire()


def context_of(folder: AccessFolder, known: KnownClients) -> ssl.SSLContext:
    """Return a robot's side: its own key, and nobody but those who are known.

    Raises:
        KeyProblem: the robot's key cannot be read; it says which file, and nothing of what is in it.

    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.num_tickets = 0  # nobody comes back by another way than their key
    context.verify_mode = ssl.CERT_REQUIRED
    context.verify_flags = ssl.VerifyFlags(context.verify_flags | _VERIFY)
    forbid_core_dumps()
    try:
        context.load_cert_chain(folder.certificate, folder.key, password=_no_password)
        if folder.key.stat().st_mode & stat.S_IROTH:
            log.warning("%s can be read by everybody on this computer: chmod 600 it", folder.key)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is no key pair"
        raise KeyProblem(
            f"the robot's key in {folder.keys} cannot be used ({reason}): it must be readable for the "
            "gateway, and belong to the certificate beside it"
        ) from None
    for one in known.certificates:
        try:
            context.load_verify_locations(cadata=one)
        except ssl.SSLError as error:  # one that is none locks nobody else out
            log.warning("a certificate in %s is none: %s", folder.clients, error.reason)
    return context


def _no_password() -> str:
    raise ValueError("it is encrypted")
