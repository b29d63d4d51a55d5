"""Who may be connected: a stop always finds a place, and those who say nothing make room."""

import socket
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack
from pathlib import Path

import pytest

from gateway.connections import connection_slots, session
from gateway.wire.limits import CLIENTS_OF_ONE_ADDRESS
from tests.support.waiting import until
from tests.unit.gateway.harness import Bench, Client, config, serving

Connect = Callable[[], Client]


@pytest.fixture
def connect(bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Connect]:
    """Of a gateway with two places, and four more for who only stops: two for each address."""
    monkeypatch.setattr(connection_slots, "CLIENTS", 2)
    monkeypatch.setattr(connection_slots, "STOPPERS", 4)
    with serving(config(tmp_path)) as address, ExitStack() as clients:
        yield lambda: clients.enter_context(Client(address))


@pytest.fixture
def full(connect: Connect) -> list[Client]:
    """All places taken, by clients that have spoken."""
    clients = [connect(), connect()]
    for client in clients:
        assert client.call("clock.read")
    return clients


def test_beyond_the_last_place_a_stop_acts_and_is_answered(connect: Connect, full: list[Client]) -> None:
    late = connect()
    assert late.call("robot.stop", reason="late")["drives"]["left_knee"] == "confirmed"
    assert late.call("robot.stop", reason="again")["held"]


def test_beyond_the_last_place_our_own_clients_may_greet_and_stop(
    connect: Connect, full: list[Client], bench: Bench
) -> None:
    late = connect()
    assert late.call("hello", client="desk", protocol=1)["robot"] == "exo-test"
    assert late.call("clock.read")
    assert late.call("robot.stop", reason="late")["held"]


def test_beyond_the_last_place_all_else_is_refused_and_ends_the_connection(
    connect: Connect, full: list[Client]
) -> None:
    late = connect()
    error = late.refused("robot.describe")
    assert error.kind == "unavailable"
    assert "to stop the robot, connect and send robot.stop first" in str(error)
    assert late.line() is None
    full[0].close()
    until(lambda: _is_served(connect), "a place is free again")


def test_who_is_refused_and_goes_on_asking_is_ended_all_the_same(
    connect: Connect, full: list[Client], bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "LAST_ANSWERS_S", 0.3)
    bench.left.hanging = Future()
    late = connect()
    late.request("robot.stop")
    late.socket.settimeout(0.05)
    told = b""

    def ended() -> bool:
        nonlocal told
        try:
            late.request("robot.describe")
            data = late.socket.recv(65536)
        except TimeoutError:
            return False
        except OSError:
            return True
        told += data
        return not data

    until(ended, "the connection ends")
    assert b'"held"' not in told  # it did not last until the stop was answered


def _is_served(connect: Connect) -> bool:
    client = connect()
    client.request("clock.read")
    message = client.line()
    return message is not None and "result" in message


def test_who_may_only_stop_and_says_nothing_is_not_kept(
    connect: Connect, full: list[Client], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "SILENCE_S", 0.1)
    assert connect().line() is None


def test_the_longest_silent_of_those_who_may_only_stop_makes_room(
    connect: Connect, full: list[Client], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection_slots, "FRESH_S", 0.0)
    silent = connect()
    for _ in range(4):
        late = connect()
        assert late.call("robot.stop", reason="late")["held"]
    message = silent.line()
    assert message is not None
    assert "others come" in message["error"]["message"]
    assert silent.line() is None


def test_a_burst_of_those_who_say_nothing_keeps_nobody_out(
    connect: Connect, full: list[Client], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection_slots, "FRESH_S", 1000.0)
    burst = [connect() for _ in range(8)]
    late = connect()
    assert late.call("robot.stop", reason="late")["held"]
    assert all(one.line() is not None for one in burst[:4])  # they were told that they made room


def test_who_has_only_just_spoken_to_stop_is_not_sent_away_for_others(
    connect: Connect, full: list[Client], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection_slots, "FRESH_S", 1000.0)
    early, beside = connect(), connect()
    for one in (early, beside):
        assert one.call("clock.read")
    others = [connect() for _ in range(3)]
    for other in others:
        message = other.line()
        assert message is not None
        assert "connect again" in message["error"]["message"]
        assert other.line() is None
    assert early.call("robot.stop", reason="early")["held"]


def test_one_address_that_takes_all_places_it_can_leaves_some_to_others(
    connect: Connect, full: list[Client], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection_slots, "FRESH_S", 1000.0)
    address = full[0].socket.getpeername()
    with ExitStack() as flood:
        for _ in range(8):
            flood.enter_context(socket.create_connection(address, source_address=("127.0.0.2", 0)))
        assert connect().call("robot.stop", reason="from elsewhere")["held"]


def test_who_has_never_said_anything_makes_room_for_who_comes(
    connect: Connect, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection_slots, "SILENT_S", 0.0)
    silent, talking = connect(), connect()
    assert talking.call("clock.read")
    assert connect().call("clock.read")
    message = silent.line()
    assert message is not None
    assert "has said nothing" in message["error"]["message"]
    assert silent.line() is None
    assert talking.call("clock.read")


def test_who_has_only_just_come_keeps_its_place(connect: Connect) -> None:
    first, second, third = connect(), connect(), connect()
    assert third.refused("robot.describe").kind == "unavailable"
    assert first.call("clock.read")
    assert second.call("clock.read")


def test_neither_silent_nor_killed_connections_keep_a_stop_out(bench: Bench, tmp_path: Path) -> None:
    """As many of each as there are places, at a gateway as it is."""
    with serving(config(tmp_path)) as address, ExitStack() as clients:
        killed = [clients.enter_context(Client(address)) for _ in range(CLIENTS_OF_ONE_ADDRESS)]
        for client in killed:
            client.call("stream.start", modules=["component"], rate_hz=0)
        silent = [clients.enter_context(Client(address)) for _ in range(CLIENTS_OF_ONE_ADDRESS)]
        assert clients.enter_context(Client(address)).call("robot.stop", reason="all taken")["held"]
        for client in killed:
            client.socket.shutdown(socket.SHUT_WR)
        assert all(all("method" in one for one in iter(client.line, None)) for client in killed)
        silent += [clients.enter_context(Client(address)) for _ in range(CLIENTS_OF_ONE_ADDRESS)]
        assert clients.enter_context(Client(address)).call("robot.stop", reason="silent ones")["held"]
