"""One encrypted connection: what its client sends keeps the thread that reads it only for a moment."""

import _ssl
import ctypes
import socket
import threading
from ctypes import c_void_p
from pathlib import Path
from types import TracebackType
from typing import Self

import pytest

from gateway.access.folder import AccessFolder
from gateway.access.known import known_in
from gateway.connections.tls import PIECE, TlsStream, context_of
from tests.support.waiting import until
from tests.unit.gateway import keyed as keys

UPDATES = 2000


class Updating:
    """A client that has keys changed as often as it likes, which Python's own cannot."""

    def __init__(self, connection: socket.socket, key: Path, certificate: Path) -> None:
        self.socket = connection
        self._lib = lib = ctypes.CDLL(_ssl.__file__)  # and with it what that is linked to
        for name in ("TLS_client_method", "SSL_CTX_new", "SSL_new", "BIO_new", "BIO_s_mem"):
            getattr(lib, name).restype = c_void_p
        self._context = c_void_p(lib.SSL_CTX_new(c_void_p(lib.TLS_client_method())))
        lib.SSL_CTX_use_certificate_file(self._context, str(certificate).encode(), 1)
        lib.SSL_CTX_use_PrivateKey_file(self._context, str(key).encode(), 1)
        self._tls = c_void_p(lib.SSL_new(self._context))
        lib.SSL_set_fd(self._tls, connection.fileno())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lib.SSL_free(self._tls)
        self._lib.SSL_CTX_free(self._context)

    def connect(self) -> None:
        assert self._lib.SSL_connect(self._tls) == 1

    def updates(self, count: int) -> bytes:
        """As they are sent."""
        lib, bio = self._lib, c_void_p(self._lib.BIO_new(c_void_p(self._lib.BIO_s_mem())))
        lib.SSL_set0_wbio(self._tls, bio)
        for _ in range(count):
            assert lib.SSL_key_update(self._tls, 0) == 1
            assert lib.SSL_do_handshake(self._tls) == 1
        found = ctypes.create_string_buffer(64 * count)
        size = lib.BIO_read(bio, found, len(found))
        return found.raw[:size]


def test_keys_that_are_changed_without_end_are_changed_a_few_at_a_time(tmp_path: Path) -> None:
    folder = AccessFolder(keys.keyed(tmp_path), {})
    ours, theirs = socket.socketpair()
    theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1024 * 1024)
    with ours, theirs, Updating(theirs, *keys.pair("viewer")) as client:
        connecting = threading.Thread(target=client.connect)
        connecting.start()
        ours.setblocking(False)
        stream = TlsStream(ours, context_of(folder, known_in(folder)))
        until(lambda: _has_ended(stream), "the handshake has ended")
        connecting.join()
        flood = client.updates(UPDATES)
        theirs.sendall(flood)
        with pytest.raises(BlockingIOError):
            stream.recv(len(flood))
        assert len(ours.recv(len(flood), socket.MSG_PEEK)) >= len(flood) - PIECE


def _has_ended(stream: TlsStream) -> bool:
    try:
        stream.handshake()
    except BlockingIOError:
        return False
    return True
