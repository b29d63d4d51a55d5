"""Started by a service manager, as systemd does it: sockets, readiness and watchdog by its own protocols."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from gateway.connections.listeners import HandoverError, inherited
from gateway.process import systemd_notify
from tests.support.waiting import WAIT_S
from tests.unit.gateway import processes
from tests.unit.gateway.harness import Client

# What systemd does for a socket unit: listens, starts the service for who comes, and again when it has ended.
LAUNCHER = """
import os, select, socket, sys
names, command = sys.argv[1], sys.argv[2:]
listeners = [socket.create_server(("127.0.0.1", 0)) for _ in names.split(":")]
print(*(listener.getsockname()[1] for listener in listeners), flush=True)
while True:
    select.select(listeners, [], [])
    child = os.fork()
    if not child:
        spare = [os.dup(listener.fileno()) for listener in listeners]
        spare = [os.dup2(descriptor, 20 + place) for place, descriptor in enumerate(spare)]
        for place, descriptor in enumerate(spare):
            os.dup2(descriptor, 3 + place)
        given = {"LISTEN_PID": str(os.getpid()), "LISTEN_FDS": str(len(spare)), "LISTEN_FDNAMES": names}
        os.execve(command[0], command, os.environ | given)
    print(child, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = tmp_path / "robot.toml"
    file.write_text(processes.RESTS_SOON, encoding="utf-8")
    return file


@pytest.fixture
def launched(file: Path) -> Iterator["subprocess.Popen[str]"]:
    command = (sys.executable, "-c", LAUNCHER, "port:classic_port", *processes.GATEWAY, str(file))
    with processes.process(*command) as launcher:
        yield launcher


def ports(launcher: "subprocess.Popen[str]") -> list[int]:
    assert launcher.stdout is not None
    return [int(word) for word in launcher.stdout.readline().split()]


def ended(launcher: "subprocess.Popen[str]") -> tuple[int, int]:
    """The next service that has ended, and its exit status."""
    assert launcher.stdout is not None
    while (line := launcher.stdout.readline()).startswith("listening on"):
        pass
    pid, status = line.split()
    return int(pid), int(status)


def test_who_came_first_is_served_and_when_all_have_gone_no_process_is_left(
    launched: "subprocess.Popen[str]",
) -> None:
    port, _ = ports(launched)
    pids = set()
    for _ in range(2):
        with Client(("127.0.0.1", port)) as client:
            assert client.call("resource.snapshot")["processes"]
        pid, status = ended(launched)
        assert status == 0
        pids.add(pid)
    assert len(pids) == 2


def test_the_paper_s_port_wakes_it_by_its_name(launched: "subprocess.Popen[str]", file: Path) -> None:
    file.write_text(processes.RESTS_SOON + "classic_port = 0\n", encoding="utf-8")
    _, classic = ports(launched)
    with socket.create_connection(("127.0.0.1", classic), WAIT_S) as connection:
        connection.sendall(b"x")
        assert int(connection.makefile().read()) > 0


def test_a_file_that_is_wrong_is_told_to_who_comes_and_fails_the_service(
    launched: "subprocess.Popen[str]", file: Path
) -> None:
    file.write_text("[robot]\n", encoding="utf-8")
    with Client(("127.0.0.1", ports(launched)[0])) as client:
        message = client.line()
        assert message is not None
        assert "name: is missing" in message["error"]["message"]
    assert ended(launched)[1] == 1


def test_sockets_for_another_process_are_left_alone_and_the_environment_is_cleared() -> None:
    environ = {"LISTEN_PID": "1", "LISTEN_FDS": "1", "LISTEN_FDNAMES": "port", "HOME": "/"}
    assert inherited(environ) is None
    assert environ == {"HOME": "/"}
    assert inherited({}) is None


@pytest.mark.parametrize(
    ("names", "says"),
    [
        ("port:other", "two sockets were handed over as port"),
        ("classic_port", "no socket was handed over as port"),
    ],
)
def test_names_that_do_not_fit_are_said(names: str, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with ExitStack() as stack:
        numbers = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in names.split(":")]
        monkeypatch.setattr(
            "gateway.connections.listeners._adopted", lambda descriptor: numbers[descriptor - 3]
        )
        environ = {"LISTEN_PID": str(os.getpid()), "LISTEN_FDS": str(len(numbers)), "LISTEN_FDNAMES": names}
        with pytest.raises(HandoverError, match=says):
            inherited(environ)


@pytest.mark.parametrize(("make", "says"), [(socket.socket, "does not listen"), (None, "is no socket")])
def test_what_is_no_listening_socket_is_refused(
    make: "type[socket.socket] | None", says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = make().detach() if make else os.open(os.devnull, os.O_RDONLY)
    monkeypatch.setattr("gateway.process.resting.FIRST", given)
    with pytest.raises(HandoverError, match=says):
        inherited({"LISTEN_PID": str(os.getpid()), "LISTEN_FDS": "1"})
    os.close(given)


# Readiness and watchdog


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(WAIT_S)
        yield manager


def test_a_gateway_that_is_watched_says_that_it_is_ready_and_alive_and_does_not_rest(
    manager: socket.socket, file: Path
) -> None:
    told = {"NOTIFY_SOCKET": manager.getsockname(), "WATCHDOG_USEC": "100000"}
    with processes.process(*processes.GATEWAY, str(file), environ=os.environ | told) as running:
        said = [manager.recv(100) for _ in range(6)]
        assert set(said) == {b"READY=1", b"WATCHDOG=1"}
        assert said.count(b"READY=1") == 1
        assert not processes.rests(running.pid)


def test_the_abstract_name_of_a_manager_is_met_and_none_is_no_trouble() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(f"\0gwrms-test-{os.getpid()}")
        manager.settimeout(WAIT_S)
        systemd_notify.tell("READY=1", {"NOTIFY_SOCKET": f"@gwrms-test-{os.getpid()}"})
        assert manager.recv(100) == b"READY=1"
    systemd_notify.tell("READY=1", {"NOTIFY_SOCKET": f"@gwrms-test-{os.getpid()}"})
    systemd_notify.tell("READY=1", {})


@pytest.mark.parametrize(
    ("environ", "period_s"),
    [
        ({}, None),
        ({"WATCHDOG_USEC": "0"}, None),
        ({"WATCHDOG_USEC": "x"}, None),
        ({"WATCHDOG_USEC": "2000000"}, 2.0),
        ({"WATCHDOG_USEC": "2000000", "WATCHDOG_PID": "1"}, None),
        ({"WATCHDOG_USEC": "2000000", "WATCHDOG_PID": str(os.getpid())}, 2.0),
    ],
)
def test_the_watchdog_s_period_is_for_us_or_not(environ: dict[str, str], period_s: float | None) -> None:
    assert systemd_notify.watchdog_s(environ) == period_s
