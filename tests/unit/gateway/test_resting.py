"""A gateway that nobody needs becomes a small process that waits, and is back for whoever comes."""

import contextlib
import os
import re
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from gateway.access import changes
from gateway.access.folder import AccessFolder
from gateway.certificates import der_of
from gateway.connections.listeners import listen
from gateway.daemon import STOP_ALONE, Daemon
from gateway.modules.stop.stop import OUTDATED
from gateway.process.loop import Loop
from gateway.registry import Registry
from gateway.wire.role import Role
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway import keyed, processes
from tests.unit.gateway.harness import HEAD, ROBOT, Bench, Client, config

Running = subprocess.Popen[str]
CLOCK = b'{"jsonrpc":"2.0","id":1,"method":"clock.read"}\n'


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Running]:
    file = tmp_path / "robot.toml"
    file.write_text(processes.RESTS_SOON, encoding="utf-8")
    with processes.process(*processes.GATEWAY, str(file)) as running:
        yield running


def test_it_rests_in_little_memory_before_and_after_it_has_served_until_a_signal_ends_it(
    running: Running,
) -> None:
    """At rest it uses no tick, and where it listens it says only once."""
    address = processes.address(running)
    until(lambda: processes.rests(running.pid), "it rests where nobody has come yet")
    for _ in range(2):
        with Client(address) as client:
            assert client.call("resource.snapshot")["processes"]
            assert (
                client.call("robot.describe")["robot"] == "exo-test"
            )  # by the modules that are the heaviest
        until(lambda: processes.rests(running.pid), "it rests")
        assert processes.resident_mb(running.pid) <= 16
    until(lambda: processes.sleeps(running.pid), "nothing wakes it")
    running.terminate()
    assert running.wait(WAIT_S) == 0
    assert running.stdout is not None
    assert running.stdout.read() == ""


def test_nobody_is_lost_who_comes_while_it_goes_to_rest_or_comes_back(running: Running) -> None:
    address = processes.address(running)
    answered = 0
    for turn in (0, 2, 4):  # at different moments of its way there and back
        with socket.create_connection(address, WAIT_S) as one:
            one.sendall(CLOCK)
            answered += one.makefile().readline().startswith('{"id":1,"result"')
        time.sleep(0.05 + turn / 30)  # they are what is tried, not waited for
    assert answered == 3


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_end_it_at_rest(running: Running, number: signal.Signals) -> None:
    processes.address(running)
    until(lambda: processes.rests(running.pid), "it rests")
    running.send_signal(number)
    assert running.wait(WAIT_S) == 0


def test_a_signal_is_met_on_the_way_there_and_back(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(processes.RESTS_SOON.replace("0.05", "0"), encoding="utf-8")
    for turn in range(4):
        with processes.process(*processes.GATEWAY, str(file)) as running:
            address = processes.address(running)
            if turn % 2:
                until(lambda: processes.rests(running.pid), "it rests")
                socket.create_connection(address, WAIT_S).close()
            time.sleep(turn * 0.05)  # another moment of the way each time
            running.terminate()
            assert running.wait(WAIT_S) == 0


def test_a_file_that_was_broken_meanwhile_is_told_to_who_comes(running: Running, tmp_path: Path) -> None:
    address, file = processes.address(running), tmp_path / "robot.toml"
    until(lambda: processes.rests(running.pid), "it rests")
    file.write_text("[robot]\n", encoding="utf-8")
    with Client(address) as client:
        said = f"{file}: [robot] name: is missing; {STOP_ALONE}"
        assert str(client.refused("robot.describe")) == said
    file.write_text(processes.RESTS_SOON, encoding="utf-8")
    until(lambda: processes.rests(running.pid), "it rests again")
    with Client(address) as client:
        assert client.call("clock.read")


def test_a_stop_is_carried_out_though_the_file_was_broken_meanwhile(running: Running, tmp_path: Path) -> None:
    """A key that was mistyped while it rested had every stop refused: the robot walked on."""
    address, file = processes.address(running), tmp_path / "robot.toml"
    for broken in ("[robot]\n", "[[[ no TOML", None):
        until(lambda: processes.rests(running.pid), "it rests")
        if broken is None:
            file.unlink()
        else:
            file.write_text(broken, encoding="utf-8")
        with Client(address) as client:
            assert client.refused("robot.describe").kind == "unavailable"
    until(lambda: processes.rests(running.pid), "it rests again, and still knows the file that was valid")
    with Client(address) as client:
        stopped = client.call("robot.stop")
    assert stopped["held"] is True
    assert stopped["outdated"] == OUTDATED.format(f"{file}: cannot be read: No such file or directory")


@pytest.mark.parametrize("host", ["192.0.2.7", "0.0.0.0"])
def test_a_stop_is_carried_out_though_the_file_asks_meanwhile_for_what_cannot_be_served(
    running: Running, tmp_path: Path, host: str
) -> None:
    """An address that it cannot listen on ended it, one that must not be served had every stop refused."""
    address, file = processes.address(running), tmp_path / "robot.toml"
    until(lambda: processes.rests(running.pid), "it rests")
    asks = f'[gateway]\nhost = "{host}"\nclassic_port = 0'
    file.write_text(processes.RESTS_SOON.replace("[gateway]", asks), encoding="utf-8")
    for _ in range(2):
        with Client(address) as client:
            assert client.refused("robot.describe").kind == "unavailable"
        with Client(address) as client:
            stopped = client.call("robot.stop")
        assert stopped["held"] is True
        assert host in stopped["outdated"]


def test_a_stop_by_the_unix_socket_is_carried_out_though_the_key_was_damaged_meanwhile(
    tmp_path: Path,
) -> None:
    keyed.keyed(tmp_path)
    file, local = tmp_path / "robot.toml", tmp_path / "gateway.sock"
    served = processes.RESTS_SOON.replace("[gateway]", f'[gateway]\nsocket = "{local.name}"')
    file.write_text(served, encoding="utf-8")
    with processes.process(*processes.GATEWAY, str(file)) as running:
        host, port = processes.address(running)
        until(lambda: processes.rests(running.pid), "it rests")
        (key,) = tmp_path.rglob("robot.key")
        key.write_text("damaged", encoding="utf-8")
        with socket.create_connection((host, port), WAIT_S) as one, contextlib.suppress(ConnectionResetError):
            assert one.recv(1) == b"", "nobody can be known without a key"
        with socket.socket(socket.AF_UNIX) as one:
            one.settimeout(WAIT_S)
            one.connect(str(local))
            one.sendall(b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":{"reason":"test"}}\n')
            answer = one.makefile().readline()
    assert '"held":true' in answer
    assert "the robot's key" in answer


def test_the_file_is_kept_as_it_is_written_whatever_the_locale(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(processes.RESTS_SOON + "# Köhler's knee, 5 °\n", encoding="utf-8")
    ascii_only = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    with processes.process(*processes.GATEWAY, str(file), environ={**os.environ, **ascii_only}) as running:
        address = processes.address(running)
        until(lambda: processes.rests(running.pid), "it rests")
        file.write_text("[robot]\n", encoding="utf-8")
        with Client(address) as client:
            assert client.call("robot.stop")["held"] is True


# Where the robot's first desk is let in meanwhile


def serves_in_plain(address: tuple[str, int]) -> bool:
    """As `gwrms stop` needs it here, without a key."""
    with socket.create_connection(address, WAIT_S) as one, contextlib.suppress(ConnectionResetError):
        one.sendall(CLOCK)
        return one.makefile().readline().startswith('{"id":1,"result"')
    return False


@pytest.mark.parametrize("is_let_in", [False, True])
def test_whoever_could_stop_it_still_can_until_it_is_started_again(
    is_let_in: bool, running: Running, tmp_path: Path
) -> None:
    """A pairing that was shown and cancelled locked every local client out of it, `gwrms stop` too."""
    address = processes.address(running)
    until(lambda: processes.rests(running.pid), "it rests")
    pairing = changes.ensure_keys(AccessFolder(tmp_path, {}), "exo-test")
    if is_let_in:
        der = der_of(keyed.pair("anna")[1].read_bytes())
        changes.admit(pairing, changes.own_fingerprint(pairing), "anna", der, Role.OPERATOR)
    for _ in range(2):
        assert serves_in_plain(address)
        until(lambda: processes.rests(running.pid), "it rests again")
    with processes.process(*processes.GATEWAY, str(tmp_path / "robot.toml")) as anew:
        assert serves_in_plain(processes.address(anew)) is not is_let_in


def test_with_keys_it_rests_and_wakes_with_them(tmp_path: Path) -> None:
    file = keyed.keyed(tmp_path) / "robot.toml"
    file.write_text(processes.RESTS_SOON, encoding="utf-8")
    with processes.process(*processes.GATEWAY, str(file)) as running:
        address = processes.address(running)
        for _ in range(2):
            until(lambda: processes.rests(running.pid), "it rests")
            with keyed.KeyedClient(address, "operator") as client:
                assert client.call("clock.read")


# What keeps it


@pytest.fixture
def serve(bench: Bench, tmp_path: Path) -> Iterator[Callable[..., tuple[Daemon, threading.Thread]]]:
    """A daemon in a thread, that ends when it is idle as soon as it `may_end`."""
    made: list[tuple[Daemon, threading.Thread]] = []

    def serve(text: str = ROBOT, outdated: str = "", **options: Any) -> tuple[Daemon, threading.Thread]:
        robot = config(tmp_path, text.replace("linger_s", 'records = "records"\nlinger_s'))
        robot = msgspec.structs.replace(robot, outdated=outdated)
        daemon = Daemon(robot, listen("127.0.0.1", 0), **options)
        thread = threading.Thread(target=daemon.run, name="daemon")
        thread.start()
        made.append((daemon, thread))
        return made[-1]

    yield serve
    for daemon, thread in made:
        if thread.is_alive():
            daemon.end()
        thread.join(WAIT_S)
        daemon._listener.close()


def may_end(daemon: Daemon) -> None:
    """Not before who is to be there has come: on a busy computer nobody comes within its `linger_s`."""
    daemon._ends_idle = True
    daemon._loop.post(daemon._left)


def test_it_ends_idle_after_linger_s_and_was_not_told(serve: Callable[..., Any], bench: Bench) -> None:
    daemon, thread = serve()
    with Client(daemon.address) as client:
        client.call("component.snapshot")
        may_end(daemon)
    thread.join(WAIT_S)
    assert not thread.is_alive()
    assert (daemon.told, bench.left.stopped) == (False, 1)
    assert daemon._listener.fileno() >= 0  # who comes now is not lost


def test_where_its_file_cannot_be_used_it_ends_soon_to_find_it_mended(serve: Callable[..., Any]) -> None:
    """It was refused until nobody had asked for `linger_s`, and a desk asks every few seconds."""
    lingers = re.sub(r"linger_s = \S+", "linger_s = 300", ROBOT)
    daemon, thread = serve(lingers, outdated="robot.toml: is broken")
    may_end(daemon)
    thread.join(WAIT_S)
    assert not thread.is_alive()


def _stays(thread: threading.Thread) -> bool:
    thread.join(0.5)  # ten times linger_s
    return thread.is_alive()


def test_a_client_that_says_nothing_keeps_it(serve: Callable[..., Any]) -> None:
    daemon, thread = serve()
    with Client(daemon.address):
        until(lambda: daemon._places.taken)
        may_end(daemon)
        assert _stays(thread)
    thread.join(WAIT_S)
    assert not thread.is_alive()


def test_a_held_stop_keeps_it_until_it_is_reset(serve: Callable[..., Any]) -> None:
    daemon, thread = serve()
    with Client(daemon.address) as client:
        client.call("robot.stop", reason="test")
        may_end(daemon)
    assert _stays(thread)
    with Client(daemon.address) as client:
        client.call("control.acquire", ttl_s=10)
        assert client.call("robot.reset")["held"] is False
    thread.join(WAIT_S)
    assert not thread.is_alive()


def test_a_trial_keeps_it_until_it_is_taken_back(serve: Callable[..., Any], bench: Bench) -> None:
    daemon, thread = serve()
    with Client(daemon.address) as client:
        client.call("control.acquire", ttl_s=10)
        client.call("parameter.write", changes={"gait.step_length": 0.45}, trial_s=100)
        may_end(daemon)
    thread.join(WAIT_S)  # the lease ends with its connection, and so does the trial
    assert not thread.is_alive()
    assert bench.gait.node.objects[0x2001, 0] == (400).to_bytes(2, "little")


def test_a_guard_keeps_it(serve: Callable[..., Any]) -> None:
    daemon, thread = serve(ROBOT + "[guard.rule.lost]\nwatch = 'node_lost'\nactions = ['alarm']\n")
    may_end(daemon)
    assert _stays(thread)


def test_who_uses_the_paper_s_exchange_keeps_it(serve: Callable[..., Any]) -> None:
    daemon, thread = serve(HEAD, classic=listen("127.0.0.1", 0))
    with socket.create_connection(("127.0.0.1", daemon.classic_port), WAIT_S):
        until(lambda: daemon._classic.busy)
        may_end(daemon)
        assert _stays(thread)
    thread.join(WAIT_S)
    assert not thread.is_alive()
    daemon._classic._listener.close()


def test_a_module_that_is_about_to_start_is_not_off(tmp_path: Path) -> None:
    loop = Loop()
    registry = Registry(config(tmp_path, HEAD), loop)
    assert registry.off
    future = registry.use("resource", None)
    assert not registry.off
    future.add_done_callback(lambda _module: registry.close(loop.stop))
    loop.run()
    loop.close()
    assert registry.off
