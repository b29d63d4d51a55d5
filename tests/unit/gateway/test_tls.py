"""One encrypted connection: what its client sends keeps the thread that reads it only for a moment."""

import _ssl
import ctypes
import os
import shutil
import socket
import ssl
import subprocess
import threading
import time
from ctypes import c_void_p
from pathlib import Path
from types import TracebackType
from typing import Self

import pytest

from gateway.access.folder import AccessFolder
from gateway.access.known_clients import known_in
from gateway.connections.tls import PIECE, TlsStream, context_of
from tests.support.waiting import until
from tests.unit.gateway import keyed as keys
from tests.unit.gateway import processes

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


# Handshakes, both sides in one thread: what the robot's side takes is its own


def handshake_ns(context: ssl.SSLContext, whose: tuple[Path, Path]) -> int:
    """What the robot's side of one takes of the CPU; raises `Refused`."""
    up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
    robot = context.wrap_bio(up, down, server_side=True)
    desk = keys.context(whose).wrap_bio(down, up)
    took_ns, open_ = 0, [desk, robot]
    while open_:
        for side in tuple(open_):
            began_ns = time.thread_time_ns()
            try:
                side.do_handshake()
                open_.remove(side)
            except ssl.SSLWantReadError:
                pass
            except ssl.SSLError as error:
                raise Refused(took_ns + time.thread_time_ns() - began_ns, error) from error
            finally:
                took_ns += (time.thread_time_ns() - began_ns) * (side is robot)
    return took_ns


class Refused(Exception):
    """What refusing took, and why it was."""

    def __init__(self, took_ns: int, error: ssl.SSLError) -> None:
        super().__init__(str(error))
        self.took_ns = took_ns


def known_to(folder: Path, *certificates: Path) -> ssl.SSLContext:
    access = AccessFolder(keys.keyed(folder, {}), {})
    for one in certificates:
        shutil.copy(one, access.clients)
    return context_of(access, known_in(access))


def test_to_refuse_a_stranger_costs_no_more_than_to_let_somebody_in(tmp_path: Path) -> None:
    context = known_to(tmp_path, keys.pair("operator")[1])
    stranger, refused_ns, admitted_ns = keys.pair("stranger"), 0, 0
    for _ in range(40):  # in turn, so that whatever else the computer does is in both
        admitted_ns += handshake_ns(context, keys.pair("operator"))
        with pytest.raises(Refused, match="certificate verify failed") as refused:
            handshake_ns(context, stranger)
        refused_ns += refused.value.took_ns
    assert refused_ns < 1.5 * admitted_ns


# A whole gateway on a computer whose clock begins in 1970

IN_1970 = """
#define _GNU_SOURCE
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
time_t time(time_t *to) { if (to) *to = 3600; return 3600; }
int clock_gettime(clockid_t which, struct timespec *to) {
    int problem = (int)syscall(SYS_clock_gettime, which, to);
    if (!problem && which == CLOCK_REALTIME) to->tv_sec = 3600;
    return problem;
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="a clock in 1970 is made by a compiler")
def test_a_robot_whose_clock_begins_in_1970_lets_in_whom_it_knows(tmp_path: Path) -> None:
    """Neither who is valid from 2049 on, nor who was paired by a desk of today, is too early for it."""
    (tmp_path / "clock.c").write_text(IN_1970, encoding="ascii")
    clock = tmp_path / "clock.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", clock, tmp_path / "clock.c"], check=True)
    early = keys.dated("of-2049-seen-in-1970", "20490101000000Z", "20591231235959Z")
    shutil.copy(early[1], keys.keyed(tmp_path) / "clients")
    (tmp_path / "robot.toml").write_text(processes.RESTS_SOON, encoding="utf-8")
    environ = {**os.environ, "LD_PRELOAD": str(clock), "XDG_STATE_HOME": str(tmp_path)}
    command = (*processes.GATEWAY, str(tmp_path / "robot.toml"))
    with processes.process(*command, environ=environ) as running:
        address = processes.address(running)
        for whose in (early, "operator"):
            with keys.KeyedClient(address, whose) as client:
                assert client.call("robot.stop", reason="now")["held"] is True
                assert client.call("clock.read")["utc_ns"] // 10**9 == 3600, "it is 1970 there"
