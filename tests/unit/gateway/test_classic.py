"""The paper's own exchange: the length, then pieces, one connection each; and clients that misbehave."""

import contextlib
import json
import os
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from gateway.config import ConfigError
from gateway.connections import acceptor, classic
from gateway.connections.listeners import listen
from gateway.daemon import Daemon
from gateway.main import main
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import HEAD, config

Call = Callable[..., bytes]


@contextlib.contextmanager
def daemon(folder: Path, outdated: str = "") -> Iterator[Daemon]:
    robot = config(folder, HEAD.replace("port = 0", "port = 0\nclassic_port = 0"))
    robot = msgspec.structs.replace(robot, outdated=outdated)
    made = Daemon(robot, listen("127.0.0.1", 0), classic=listen("127.0.0.1", 0))
    ready = threading.Event()
    thread = threading.Thread(target=made.run, args=(ready.set,), name="daemon")
    thread.start()
    try:
        assert ready.wait(WAIT_S)
        yield made
    finally:
        made.end()
        thread.join(WAIT_S)


def test_while_the_robots_file_cannot_be_used_nobody_is_served(tmp_path: Path) -> None:
    with daemon(tmp_path, outdated="robot.toml: is broken") as made:
        assert made.classic_port is not None
        come = socket.create_connection(("127.0.0.1", made.classic_port), WAIT_S)
        with come, contextlib.suppress(ConnectionResetError):
            come.sendall(b"x")
            assert come.recv(1) == b""


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Daemon]:
    with daemon(tmp_path) as made:
        yield made


@pytest.fixture
def address(running: Daemon) -> tuple[str, int]:
    assert running.classic_port is not None
    return "127.0.0.1", running.classic_port


@pytest.fixture
def call(address: tuple[str, int]) -> Call:
    """One connection: what comes back for what was sent, from `source`."""

    def call(said: bytes = b"x", source: str = "127.0.0.1") -> bytes:
        with socket.create_connection(address, WAIT_S, (source, 0)) as connection:
            connection.sendall(said)
            return b"".join(iter(lambda: connection.recv(65536), b""))

    return call


def exchange(call: Call, **options: Any) -> tuple[list[dict[str, Any]], list[bytes]]:
    """A whole one, as the paper's client does it: the list, and the pieces it came in."""
    length, pieces = int(call(**options)), list[bytes]()
    while sum(map(len, pieces)) < length:
        pieces.append(call(**options))
    assert sum(map(len, pieces)) == length
    return json.loads(b"".join(pieces)), pieces


def test_the_length_then_pieces_of_at_most_8000_bytes(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(classic, "PIECE_BYTES", 300)
    table, pieces = exchange(call)
    assert [len(piece) for piece in pieces[:-1]] == [300] * (len(pieces) - 1)
    assert 0 < len(pieces[-1]) <= 300
    assert [row["pid"] for row in table] == sorted(row["pid"] for row in table)
    (own,) = (row for row in table if row["pid"] == os.getpid())
    assert own.keys() == {"name", "pid", "cpu", "mem"}
    assert own["mem"] > 1 << 20
    assert own["cpu"] is None


def test_the_next_exchange_has_percentages_since_the_last(call: Call) -> None:
    exchange(call)
    (own,) = (row for row in exchange(call)[0] if row["pid"] == os.getpid())
    assert own["cpu"] >= 0


@pytest.mark.parametrize(
    "said", [b"\0", b"get processes\n", b"x" * 100_000], ids=["a byte", "a line", "much"]
)
def test_anything_will_do_as_a_request(call: Call, said: bytes) -> None:
    assert int(call(said)) > 0


def test_each_address_has_its_own_exchange(call: Call) -> None:
    length = int(call())
    table, _ = exchange(call, source="127.0.0.2")
    assert {1, os.getpid()} <= {row["pid"] for row in table}
    piece = call()
    assert piece.startswith(b"[{")
    assert len(piece) == min(length, classic.PIECE_BYTES)


def test_an_exchange_that_was_given_up_is_forgotten(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(classic, "EXPIRES_S", 0.05)
    assert int(call()) > 0

    def begins_anew() -> bool:
        time.sleep(0.1)  # longer than EXPIRES_S
        return call().isdigit()

    until(begins_anew, "a length instead of a piece")


def test_a_client_that_says_nothing_is_let_go_and_takes_nothing(
    call: Call, address: tuple[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert int(call()) > 0
    with socket.create_connection(address, WAIT_S) as connection:
        connection.shutdown(socket.SHUT_WR)
        assert connection.recv(1) == b""
    monkeypatch.setattr(classic, "CALL_S", 0.05)
    with socket.create_connection(address, WAIT_S) as connection:
        assert connection.recv(1) == b""
    assert call().startswith(b"[{")


def test_a_client_that_keeps_its_connection_is_let_go(
    address: tuple[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(classic, "CALL_S", 0.2)
    with socket.create_connection(address, WAIT_S) as connection:
        connection.sendall(b"x")
        while connection.recv(64):
            pass

        def refused() -> bool:
            try:
                connection.sendall(b"x")
            except OSError:
                return True
            return False

        until(refused, "the gateway has closed its end too")


def test_too_many_connections_and_addresses_are_closed_at_once(
    call: Call, address: tuple[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(classic, "MOST_CALLS", 1)
    monkeypatch.setattr(classic, "MOST_EXCHANGES", 1)
    assert int(call()) > 0

    def closed(source: str) -> bool:
        with contextlib.suppress(ConnectionError):
            return call(source=source) == b""
        return True

    until(lambda: closed("127.0.0.2"), "another address is one too many")
    with socket.create_connection(address, WAIT_S) as silent:
        until(lambda: closed("127.0.0.1"), "a second connection is one too many")
        silent.sendall(b"x")
        assert silent.recv(1) == b"["


def test_without_descriptors_it_rests_and_goes_on(
    call: Call, running: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert int(call()) > 0
    monkeypatch.setattr(acceptor, "REST_S", 0.01)
    refusals = [OSError(24, "Too many open files")] * 3
    accept = socket.socket.accept

    def refuse(self: socket.socket) -> Any:
        if refusals:
            raise refusals.pop()
        return accept(self)

    monkeypatch.setattr(socket.socket, "accept", refuse)
    assert call().startswith(b"[{")
    assert refusals == []


def test_it_is_off_unless_configured_and_its_port_in_use_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert config(tmp_path, HEAD).gateway.classic_port is None
    with listen("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        config(tmp_path, HEAD.replace("port = 0", f"port = 0\nclassic_port = {port}"))
        assert main(["gateway", str(tmp_path / "robot.toml")]) == 1
        assert re.search(f"127.0.0.1:{port}: .*classic_port", capsys.readouterr().err)
    with pytest.raises(ConfigError, match="classic_port"):
        config(tmp_path, HEAD.replace("port = 0", "port = 0\nclassic_port = 70000"))


def test_the_gateway_ends_in_the_middle_of_an_exchange(tmp_path: Path) -> None:
    with daemon(tmp_path) as running:
        assert running.classic_port is not None
        silent = socket.create_connection(("127.0.0.1", running.classic_port), WAIT_S)
        with socket.create_connection(("127.0.0.1", running.classic_port), WAIT_S) as connection:
            connection.sendall(b"x")
            assert connection.recv(16).isdigit()
    with silent, contextlib.suppress(ConnectionResetError):
        assert silent.recv(1) == b""
