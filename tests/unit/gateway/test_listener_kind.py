"""Which socket is served, and who comes in there: by where it listens, and at a Unix socket by account."""

import contextlib
import os
import pwd
import socket
import stat
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.access.identity import Identity, Peer
from gateway.access.table import AccessTable
from gateway.access.users import identity_of, peer_of, resolved
from gateway.cli.serve import _local
from gateway.connections import accounts
from gateway.connections.listener_kind import ListenerKind, UnsafeListener, kind_of
from gateway.connections.listeners import Listeners, inherited, listen, listen_locally
from gateway.daemon import Daemon
from gateway.main import main
from gateway.wire.limits import HANDSHAKES
from gateway.wire.role import Role
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import HEAD, STOP, Bench, Client, config, serving
from tests.unit.gateway.keyed import KeyedClient, keyed, raw, said

ROBOT = Path("/etc/gwrms/robot.toml")
SOMEBODY = Peer(12_345, 12_345)  # whom no computer of a test knows


class LocalClient(Client):
    """One connection by a Unix socket."""

    def __init__(self, path: Path) -> None:
        self.path = path
        super().__init__(("", 0))

    def _connected(self, _address: tuple[str, int]) -> socket.socket:
        made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        made.settimeout(WAIT_S)
        made.connect(str(self.path))
        return made


@pytest.fixture
def local(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A gateway's Unix socket; nothing is said of anybody yet. The directory of accounts is waited for."""
    monkeypatch.setattr(accounts, "SHORT_S", WAIT_S)
    monkeypatch.setattr(accounts, "HANDSHAKE_S", WAIT_S)
    path = tmp_path / "s"
    with serving(config(tmp_path), local=listen_locally(path)):
        yield path
    assert not path.exists(), "it goes with its gateway"


# Which sockets are served


@pytest.mark.parametrize("has_keys", [False, True])
@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.9", "::1"])
def test_this_computer_is_served_with_keys_and_without(host: str, has_keys: bool) -> None:
    with listen(host, 0) as listener:
        assert kind_of(listener, has_keys=has_keys, robot=ROBOT) is (
            ListenerKind.TLS if has_keys else ListenerKind.PLAIN
        )


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
def test_other_computers_are_served_with_keys_only(host: str) -> None:
    with listen(host, 0) as listener:
        assert kind_of(listener, has_keys=True, robot=ROBOT) is ListenerKind.TLS
        with pytest.raises(
            UnsafeListener, match=r"`gwrms keys pair /etc/gwrms/robot.toml` here.*`gwrms pair HOST:PORT`"
        ):
            kind_of(listener, has_keys=False, robot=ROBOT)


def test_without_keys_the_command_refuses_other_computers_and_says_what_leads_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "robot.toml").write_text(HEAD, encoding="utf-8")
    assert main(["gateway", str(tmp_path / "robot.toml"), "--host", "0.0.0.0"]) == 1
    error = capsys.readouterr().err
    assert f"gwrms keys pair {tmp_path / 'robot.toml'}" in error
    assert "`gwrms pair HOST:PORT`" in error


def test_a_socket_that_was_handed_over_is_judged_by_where_it_listens(bench: Bench, tmp_path: Path) -> None:
    """Its robot's file says 127.0.0.1."""
    with listen("0.0.0.0", 0) as handed, pytest.raises(UnsafeListener):
        Daemon(config(tmp_path), handed)


def test_the_paper_s_port_is_for_this_computer_only(bench: Bench, tmp_path: Path) -> None:
    keyed(tmp_path)
    robot, refused = config(tmp_path), pytest.raises(UnsafeListener, match="classic_port")
    with listen("127.0.0.1", 0) as port, listen("0.0.0.0", 0) as classic, refused:
        Daemon(robot, port, classic=classic)


def test_with_keys_every_tcp_connection_is_tls_and_the_unix_socket_is_not(
    bench: Bench, tmp_path: Path
) -> None:
    keyed(tmp_path)
    with serving(config(tmp_path), local=listen_locally(tmp_path / "s")) as address:
        with raw(address) as bare:
            bare.sendall(b"{}\n")
            assert said(bare) == b""
        with KeyedClient(address, "viewer") as client, LocalClient(tmp_path / "s") as here:
            assert client.call("clock.read")["boot_id"] == here.call("clock.read")["boot_id"]


# Which CAN buses are


@pytest.mark.parametrize(
    ("bus", "refused"),
    [
        ('interface = "socketcand"\nchannel = "can0"\nhost = "192.0.2.7"\nport = 29536', "192.0.2.7"),
        ('interface = "socketcand"\nchannel = "can0"\nhost = "127.0.0.1"\nport = 29536', None),
        ('interface = "udp_multicast"\nchannel = "239.74.163.2"', "the multicast group 239.74.163.2"),
        ('interface = "udp_multicast"\nchannel = "239.74.163.2"\nhop_limit = 0', None),
        ('interface = "socketcan"\nchannel = "can0"', None),
    ],
)
def test_a_bus_over_a_network_is_refused_unless_the_file_trusts_that_network(
    tmp_path: Path, bus: str, refused: str | None
) -> None:
    text = f'[robot]\nname = "x"\n[can.main]\n{bus}\n'
    if refused is None:
        assert config(tmp_path, text).can
        return
    with pytest.raises(ValueError, match=f"goes over {refused}.*trusted_network = true"):
        config(tmp_path, text)
    assert config(tmp_path, f"{text}trusted_network = true\n").can["main"].trusted_network


# People on the robot


def test_the_account_that_the_gateway_runs_as_may_everything(bench: Bench, local: Path) -> None:
    with LocalClient(local) as client:
        hello = client.call("hello", client="test")
        assert (hello["role"], hello["identity"]) == ("maintainer", pwd.getpwuid(os.geteuid()).pw_name)
        assert client.call("robot.stop", reason="now")["held"] is True
        who = client.call("journal.tail", n=1)["entries"][0]["who"]
        assert f"(uid {os.geteuid()}:" in who


def test_a_stranger_s_uid_is_told_so_and_may_not_even_stop(
    bench: Bench, local: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("gateway.access.users.peer_of", lambda _connection: SOMEBODY)
        with LocalClient(local) as client, contextlib.suppress(OSError):
            client.send(STOP % b"from a stranger")
            assert "result" not in (client.line() or {})
        with LocalClient(local) as client:
            error = (client.line() or {})["error"]
            assert error["data"]["kind"] == "not_allowed"
            assert "uid 12345 is a user whom this robot does not know" in error["message"]
            assert client.line() is None
    with LocalClient(local) as client:
        assert client.call("robot.describe")["stop"]["held"] is False


AS_A_STRANGER = """
import os, socket, sys
path, line = sys.argv[1:]
os.setgroups([]); os.setgid(65534); os.setuid(65534)
with socket.socket(socket.AF_UNIX) as made:
    made.settimeout(30)
    made.connect(path)
    try:
        made.sendall(line.encode())
    except OSError:
        pass
    try:
        while more := made.recv(4096):
            sys.stdout.write(more.decode())
    except ConnectionResetError:
        pass
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can be somebody else")
def test_the_kernel_tells_a_stranger_s_uid_and_nothing_of_theirs_is_done(
    bench: Bench, tmp_path: Path
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)  # so that everybody may knock
        local = Path(folder) / "s"
        with serving(config(tmp_path), local=listen_locally(local)):
            stop = (STOP % b"from a stranger").decode()
            command = [sys.executable, "-P", "-c", AS_A_STRANGER, str(local), stop]
            ran = subprocess.run(command, capture_output=True, text=True, check=True, timeout=WAIT_S)
            assert "uid 65534 is a user whom this robot does not know" in ran.stdout
            assert '"result"' not in ran.stdout
            with LocalClient(local) as client:
                assert client.call("robot.describe")["stop"]["held"] is False


def test_who_is_in_the_table_is_let_in_and_goes_when_taken_out(
    bench: Bench, local: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.access.users.peer_of", lambda _connection: SOMEBODY)
    (tmp_path / "access.toml").write_text('[users]\n12345 = "viewer"\n', encoding="utf-8")
    with LocalClient(local) as client:
        assert client.refused("control.acquire", ttl_s=10).kind == "not_allowed"
        (tmp_path / "access.toml").unlink()
        until(lambda: client.line() is None, "it is closed")


@pytest.fixture
def hanging(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """The computer's directory of accounts answers nobody, until this is set."""
    answers = threading.Event()
    monkeypatch.setattr(accounts, "resolved", lambda peer: [answers.wait(WAIT_S), peer][1])
    yield answers
    answers.set()
    until(lambda: not any(one.name == "directory" for one in threading.enumerate()), "it has answered")


def test_a_directory_that_hangs_holds_up_nobody_and_the_gateway_s_own_account_comes_in(
    bench: Bench, local: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    with LocalClient(local) as early:
        early.call("clock.read")
        answers = request.getfixturevalue("hanging")
        monkeypatch.setattr(accounts, "SHORT_S", WAIT_S)
        with LocalClient(local) as late:
            asked = late.request("hello", client="test")
            assert early.call("robot.stop", reason="now")["held"] is True
            monkeypatch.setattr(accounts, "SHORT_S", 0.0)
            with LocalClient(local) as later:
                assert later.call("hello", client="test")["role"] == "maintainer"
                assert later.call("hello", client="test")["identity"] == str(os.geteuid())
            answers.set()
            assert late.answer(asked)["role"] == "maintainer"


def test_who_is_let_in_by_a_name_that_nobody_tells_is_sent_away(
    bench: Bench, local: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hanging: threading.Event
) -> None:
    monkeypatch.setattr("gateway.access.users.peer_of", lambda _connection: SOMEBODY)
    monkeypatch.setattr(accounts, "HANDSHAKE_S", 0.0)
    (tmp_path / "access.toml").write_text('[users]\nsomebody = "viewer"\n', encoding="utf-8")
    for _ in range(2 * HANDSHAKES):  # of which only so many are asked for at once
        with LocalClient(local) as client:
            assert (client.line() or {})["error"]["data"]["kind"] == "not_allowed"
    assert sum(one.name == "directory" for one in threading.enumerate()) == HANDSHAKES
    (tmp_path / "access.toml").write_text('[users]\n12345 = "viewer"\n', encoding="utf-8")
    with LocalClient(local) as client:
        assert client.call("hello", client="test")["role"] == "viewer"


@pytest.mark.parametrize(
    ("table", "role"),
    [
        ({}, None),
        ({"users": {"12345": Role.VIEWER}}, Role.VIEWER),
        ({"groups": {"12345": Role.OPERATOR}}, Role.OPERATOR),
        ({"users": {"12345": Role.VIEWER}, "groups": {"12345": Role.OPERATOR}}, Role.OPERATOR),
        ({"users": {"somebody": Role.MAINTAINER}, "groups": {"else": Role.MAINTAINER}}, None),
    ],
)
def test_the_highest_role_of_user_and_groups_counts(table: dict[str, Any], role: Role | None) -> None:
    found = identity_of(SOMEBODY, AccessTable(**table))
    assert found == (None if role is None else Identity(role, "12345", peer=SOMEBODY))


def test_names_of_user_and_groups_are_those_of_the_computer() -> None:
    found = resolved(Peer(0, 0))
    assert (found.name, "root" in found.groups, "0" in found.groups) == ("root", True, True)
    assert resolved(SOMEBODY) == SOMEBODY
    named = Peer(12_345, 12_345, "somebody", ("12345", "exo"))
    who = identity_of(named, AccessTable(groups={"exo": Role.OPERATOR}))
    assert who == Identity(Role.OPERATOR, "somebody", peer=named)


def test_an_account_whose_name_is_a_number_is_nobody_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """A directory on the network may have such a one; the table means the number."""
    monkeypatch.setattr("pwd.getpwuid", lambda uid: SimpleNamespace(pw_name="1001"))
    monkeypatch.setattr("os.getgrouplist", lambda name, gid: [2000])
    monkeypatch.setattr("grp.getgrgid", lambda gid: SimpleNamespace(gr_name="27"))
    table = AccessTable(users={"1001": Role.MAINTAINER}, groups={"27": Role.OPERATOR})
    assert identity_of(resolved(Peer(2000, 2000)), table) is None
    assert identity_of(resolved(Peer(1001, 2000)), table) == Identity(
        Role.MAINTAINER, "1001", peer=Peer(1001, 2000, "", ("2000",))
    )


def test_who_is_at_the_other_end_is_what_the_kernel_says() -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX)
    with ours, theirs:
        assert peer_of(ours) == Peer(os.getuid(), os.getgid())


# The Unix socket itself


def test_everybody_may_knock_and_what_a_gateway_has_left_is_taken_away(tmp_path: Path) -> None:
    path = tmp_path / "run" / "exo.sock"
    for _ in range(2):
        with listen_locally(path):
            assert stat.S_IMODE(path.stat().st_mode) == 0o666
    with listen_locally(path), pytest.raises(OSError, match=r"cannot listen on .*exo\.sock.*choose another"):
        listen_locally(path)


@pytest.mark.parametrize(
    ("more", "environ", "expected"),
    [
        ("", {}, None),
        ("", {"XDG_RUNTIME_DIR": "run"}, "run/gwrms/exo-test.sock"),
        ("", {"RUNTIME_DIRECTORY": "run/gwrms", "XDG_RUNTIME_DIR": "other"}, "run/gwrms/exo-test.sock"),
        ('socket = ""', {"XDG_RUNTIME_DIR": "run"}, None),
        ('socket = "here.sock"', {"XDG_RUNTIME_DIR": "run"}, "here.sock"),
    ],
)
def test_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: str, environ: dict[str, str], expected: str | None
) -> None:
    for name in ("RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"):
        monkeypatch.delenv(name, raising=False)
    for name, folder in environ.items():
        monkeypatch.setenv(name, str(tmp_path / folder))
    made = _local(config(tmp_path, HEAD.replace("[gateway]", f"[gateway]\n{more}")))
    if expected is None:
        assert made is None
    else:
        assert made is not None
        with made:
            assert made.getsockname() == str(tmp_path / expected)


def test_a_unix_socket_is_handed_over_by_what_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with listen("127.0.0.1", 0) as port, listen_locally(tmp_path / "s") as local:
        at = iter([port.detach(), local.detach()])
        monkeypatch.setattr("gateway.connections.listeners.resting.FIRST", 0)
        adopt = "gateway.connections.listeners._adopted"
        monkeypatch.setattr(adopt, lambda _place: socket.socket(fileno=next(at)))
        environ = {"LISTEN_PID": str(os.getpid()), "LISTEN_FDS": "2", "LISTEN_FDNAMES": "port:port"}
        found = inherited(environ)
        assert isinstance(found, Listeners)
        assert list(found.named) == ["port", "socket"]
        found.close()
