"""One TLS connection, read by one thread and written by another: a stop waits for nobody slow."""

import os
import ssl
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any, cast

import pytest

from drivers.realtime_priority import PRIORITY
from gateway.connections.tls import TlsStream
from tests.support.waiting import WAIT_S, until


class Plain:
    """OpenSSL that encrypts nothing, and has decrypted four bytes."""

    def wrap_bio(self, _come: ssl.MemoryBIO, goes: ssl.MemoryBIO, **_how: object) -> "Plain":
        self._goes = goes
        return self

    def write(self, data: memoryview) -> int:
        return self._goes.write(data)

    def read(self, _most: int) -> bytes:
        return b"stop"

    def pending(self) -> int:
        return 4


def stream_on(slow: "Slow") -> TlsStream:
    return TlsStream(cast("Any", slow), cast("Any", Plain()))


class Slow:
    """A connection whose record is being written until a test lets it go."""

    def __init__(self) -> None:
        self.writes, self.go_on = threading.Event(), threading.Event()
        self.writer = 0

    def send(self, data: memoryview) -> int:
        self.writer = threading.get_native_id()
        self.writes.set()
        assert self.go_on.wait(WAIT_S)
        return len(data)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int, int]]:
    """Who was given which policy and priority; the system is not asked, which may forbid it."""
    made: list[tuple[int, int, int]] = []

    def give(thread: int, policy: int, parameters: Any) -> None:
        made.append((thread, policy & ~os.SCHED_RESET_ON_FORK, parameters.sched_priority))

    monkeypatch.setattr(os, "sched_setscheduler", give)
    return made


@pytest.mark.parametrize(("work", "found"), [("recv", b"stop"), ("pending", 4)])
def test_who_writes_is_urgent_while_a_reader_waits_for_it(
    asked: list[tuple[int, int, int]], work: str, found: object
) -> None:
    slow = Slow()
    stream = stream_on(slow)
    with ThreadPoolExecutor(2) as pool:
        try:
            writing = pool.submit(stream.send, b"x")
            assert slow.writes.wait(WAIT_S)
            reading = pool.submit(getattr(stream, work), *([4096] if work == "recv" else []))
            until(lambda: bool(asked), "it is urgent")
            assert asked == [(slow.writer, os.SCHED_FIFO, PRIORITY)]
            assert not reading.done()
        finally:
            slow.go_on.set()
        assert (writing.result(), reading.result()) == (1, found)
    assert asked[1:] == [(slow.writer, os.SCHED_OTHER, 0)], "and no longer than that"


def test_where_nobody_writes_nobody_is_asked(asked: list[tuple[int, int, int]]) -> None:
    slow = Slow()
    slow.go_on.set()
    stream = stream_on(slow)
    assert stream.send(b"x") == 1
    assert (stream.recv(4096), stream.pending()) == (b"stop", 4)
    assert asked == []


def test_where_the_system_forbids_it_a_reader_waits_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    refused = threading.Event()

    def refuse(*_what: object) -> None:
        refused.set()
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    slow = Slow()
    stream = stream_on(slow)
    with ThreadPoolExecutor(2) as pool:
        try:
            pool.submit(stream.send, b"x")
            assert slow.writes.wait(WAIT_S)
            reading = pool.submit(stream.recv, 4096)
            assert refused.wait(WAIT_S)
        finally:
            slow.go_on.set()
        assert reading.result() == b"stop"
