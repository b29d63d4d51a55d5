"""TLS 1.3 on one connection, and what a robot says and asks for in it. Imported only where there are keys."""

import logging
import resource
import ssl
import threading
from typing import Final

from gateway.access.folder import AccessFolder
from gateway.access.known import Known
from gateway.certificates import KeyProblem

log = logging.getLogger(__name__)

RECORD: Final = 16 * 1024  # the most that one record holds (RFC 8446 §5.1)
NO_CHECK_TIME: Final = 0x20_0000  # X509_V_FLAG_NO_CHECK_TIME: a robot without a clock begins in 1970
_WAITS: Final = (ssl.SSLWantReadError, ssl.SSLWantWriteError)


class TlsStream:
    """Encrypts one socket; one thread reads it, and another one writes."""

    __slots__ = ("_lock", "_socket")

    def __init__(self, connection: ssl.SSLSocket) -> None:
        self._socket = connection
        self._lock = threading.Lock()  # OpenSSL lets one thread at a time into a connection

    def fileno(self) -> int:
        return self._socket.fileno()

    def recv(self, most: int) -> bytes:
        """As of a socket: raises `BlockingIOError` where nothing has come."""
        try:
            with self._lock:
                return self._socket.recv(most)
        except _WAITS as error:
            raise BlockingIOError from error

    def pending(self) -> int:
        """Bytes that have been decrypted already, and of which no poll tells."""
        with self._lock:
            return self._socket.pending()

    def send(self, data: bytes | memoryview) -> int:
        """A record at most, so that whoever reads waits no longer than for that."""
        try:
            with self._lock:
                return self._socket.send(data[:RECORD])
        except _WAITS as error:
            raise BlockingIOError from error

    def close(self) -> None:
        self._socket.close()


def context_of(folder: AccessFolder, known: Known) -> ssl.SSLContext:
    """A robot's side: its own key, and nobody but those who are known.

    Raises:
        KeyProblem: the robot's key cannot be read; it says which file, and nothing of what is in it.

    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.num_tickets = 0  # nobody comes back by another way than their key
    context.verify_mode = ssl.CERT_REQUIRED
    context.verify_flags = ssl.VerifyFlags(context.verify_flags | NO_CHECK_TIME)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a dump would hold the key
    try:
        context.load_cert_chain(folder.certificate, folder.key, password=_no_password)
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
