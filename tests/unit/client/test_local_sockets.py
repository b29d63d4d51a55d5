"""A robot with keys on its own computer: its accounts find its Unix socket by themselves."""

import contextlib
import dataclasses
import os
import shutil
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway import own_folders
from gateway.cli import serve
from gateway.client import Address, LinkLost, LinkSettings, NotPaired, Robot, Unreachable, WrongRobot
from gateway.client.keys import keys_folder
from gateway.client.local_sockets import listens_at, local_sockets, sockets_instead
from gateway.connections.listeners import listen, listen_locally
from gateway.main import main
from tests.unit.gateway import keyed as keys
from tests.unit.gateway.harness import HEAD, Bench, config, serving
from tests.unit.gateway.keyed import keyed

ONCE = LinkSettings(client="test", reconnect=False)


@pytest.fixture
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Of a login; /run/gwrms is none that may be written to."""
    folder = tmp_path / "run"
    folder.mkdir(mode=0o700)
    (tmp_path / "plain").write_text("")
    monkeypatch.setattr(own_folders, "SYSTEM", tmp_path / "plain" / "gwrms")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    for name in ("RUNTIME_DIRECTORY", "SUDO_UID"):
        monkeypatch.delenv(name, raising=False)
    return folder


@pytest.fixture
def folder(tmp_path: Path, session: Path) -> Path:
    """Where a user's gateway with keys has its socket."""
    assert session.is_dir()
    return tmp_path / "config" / "gwrms"


@pytest.fixture
def address(tmp_path: Path, session: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Address]:
    """Of a robot with keys, started as `gwrms gateway` starts it; the user here has no key."""
    assert session.is_dir()
    monkeypatch.setattr("gateway.modules.component.module.assemble", Bench().assemble)
    robot = config(keyed(tmp_path))
    with serving(robot, local=serve._local(robot)) as (host, port):
        yield Address(host, port)


def test_the_user_of_a_robot_with_keys_stops_and_resets_it_there_without_a_key(
    address: Address, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["stop", "--robot", str(address)]) == 0
    assert "confirmed" in capsys.readouterr().out
    assert main(["reset", "--robot", str(address)]) == 0
    assert main(["describe", "--robot", str(address)]) == 0


def test_a_stale_socket_and_one_of_another_robot_are_passed_over(
    address: Address, folder: Path, tmp_path: Path
) -> None:
    (tmp_path / "other").mkdir()
    other = config(tmp_path / "other", HEAD.replace("exo-test", "a-first-one"))
    with socket.socket(socket.AF_UNIX) as stale:
        stale.bind(str(folder / "0-stale.sock"))
    with serving(other, local=serve._local(other)), Robot(address, ONCE) as robot:
        assert robot.hello is not None
        assert robot.hello.robot == "exo-test"
        assert robot.hello.listens == str(address)


def test_a_program_that_never_answers_at_a_socket_delays_nobody(address: Address, folder: Path) -> None:
    began_s, patient = time.monotonic(), dataclasses.replace(ONCE, call_timeout_s=60)
    with listen_locally(folder / "0-hung.sock"), Robot(address, patient) as robot:
        assert robot.hello is not None
        assert robot.hello.robot == "exo-test"
        assert time.monotonic() - began_s < patient.call_timeout_s


def test_a_socket_in_a_folder_that_others_may_write_to_is_not_believed(
    address: Address, folder: Path
) -> None:
    folder.chmod(0o777)
    with pytest.raises(LinkLost, match=r"gwrms pair.*at its Unix socket"):
        Robot(address, ONCE)


def test_a_folder_that_another_user_has_made_is_not_believed(folder: Path) -> None:
    folder.mkdir(parents=True)
    made_by = folder.stat().st_uid
    assert own_folders._is_safe(folder, {made_by})
    assert not own_folders._is_safe(folder, {made_by + 1})


def test_another_robot_that_is_pinned_there_is_not_gone_around(address: Address) -> None:
    keys_folder().mkdir(parents=True, mode=0o700)
    for file, name in zip(keys.pair("operator"), ("desk.key", "desk.crt"), strict=True):
        shutil.copy(file, keys_folder() / name)
    with pytest.raises(WrongRobot) as refused:
        Robot(Address(address.host, address.port, keys.pin("impostor")), ONCE)
    assert "served at" not in str(refused.value), "it is not steered around either"


def test_a_paired_robot_is_never_asked_at_a_socket(address: Address, folder: Path) -> None:
    """Nothing there proves to have its key: this desk was revoked, and has an account on the robot, too."""
    assert local_sockets(address) == [Address(str(folder / "exo-test.sock"), 0)]
    assert local_sockets(Address(address.host, address.port, keys.pin("impostor"))) == []


def test_another_robot_does_not_stand_in_for_one_whose_gateway_is_off(address: Address, folder: Path) -> None:
    """It has the same port of another host; a stop would be confirmed by drives that nobody meant."""
    elsewhere = Address("127.0.0.9", address.port)
    with pytest.raises(
        Unreachable, match=rf"no gateway at 127\.0\.0\.9.*\? On this .* at {folder}/exo-test\.sock: is"
    ):
        Robot(elsewhere, ONCE)


def test_a_socket_that_a_killed_gateway_has_left_is_not_offered(folder: Path) -> None:
    folder.mkdir(parents=True)
    with socket.socket(socket.AF_UNIX) as stale:
        stale.bind(str(folder / "stale.sock"))
        assert sockets_instead(Address("127.0.0.9")) == ""


def test_an_address_of_the_network_that_is_this_computer_s_leads_to_its_socket_too(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It said that nothing is said to another computer in plain."""
    monkeypatch.setattr("gateway.client.keys.is_loopback", lambda _address: False)
    monkeypatch.setattr("gateway.client.local_sockets.is_loopback", lambda _address: False)
    monkeypatch.setattr("gateway.modules.component.module.assemble", Bench().assemble)
    robot = config(keyed(tmp_path))
    with serving(robot, local=serve._local(robot)) as (host, port), Robot(Address(host, port), ONCE) as found:
        assert found.hello is not None
        assert found.hello.robot == "exo-test"
        assert folder.is_dir()
    with pytest.raises(NotPaired, match=r"192\.0\.2\.7:7420 is not paired"):
        Robot(Address("192.0.2.7"), ONCE)


@pytest.mark.parametrize(
    ("listens", "expected"),
    [
        ("127.0.0.1:7420", True),
        ("0.0.0.0:7420", True),
        ("[::]:7420", False),
        ("127.0.0.2:7420", False),
        ("192.0.2.7:7420", False),
        ("127.0.0.1:7421", False),
        (None, False),
    ],
)
def test_whether_a_gateway_is_the_one_at_an_address(listens: str | None, expected: bool) -> None:
    assert listens_at(Address(), listens) is expected


def test_localhost_is_the_address_that_was_reached_by_it() -> None:
    """With a gateway at each of its two addresses, the other one's drives would be stopped."""
    for listens in ("127.0.0.1:7420", "0.0.0.0:7420"):
        assert listens_at(Address("localhost"), listens)
        assert not listens_at(Address("::1"), listens)
    for listens in ("[::1]:7420", "[::]:7420"):
        assert not listens_at(Address("localhost"), listens)
        assert listens_at(Address("::1"), listens)


@pytest.mark.parametrize(("reached", "expected"), [("127.0.0.1", "exo-test"), ("::1", "at-six")])
def test_of_two_gateways_at_localhost_the_one_that_was_reached_is_asked_at_its_socket(
    reached: str, expected: str, address: Address, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    try:
        listener = listen("::1", address.port)
    except OSError:
        pytest.skip("this computer has no ::1")
    monkeypatch.setattr("tests.unit.gateway.harness.listen", lambda *_: listener)
    (tmp_path / "six").mkdir()
    other = config(keyed(tmp_path / "six"), HEAD.replace("exo-test", "at-six"))
    family = socket.AF_INET6 if ":" in reached else socket.AF_INET
    where = (family, socket.SOCK_STREAM, 6, "", (reached, address.port))
    with serving(other, local=serve._local(other)):
        monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: [where])
        with Robot(Address("localhost", address.port), ONCE) as robot:
            assert robot.hello is not None
            assert robot.hello.robot == expected


def test_a_socket_does_not_stand_in_for_a_port_at_which_nobody_listens(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its gateway may have this address in another network of its own, as a container has."""
    monkeypatch.setattr("gateway.modules.component.module.assemble", Bench().assemble)
    robot = config(keyed(tmp_path))
    with socket.socket() as dead:
        dead.bind(("127.0.0.1", 0))
        gone = Address(*dead.getsockname())
        monkeypatch.setattr("gateway.daemon.said", lambda _: str(gone))
        with serving(robot, local=serve._local(robot)):
            with Robot(str(folder / "exo-test.sock"), ONCE) as found:
                assert found.hello is not None
                assert found.hello.listens == str(gone)
            with pytest.raises(Unreachable, match="no gateway at"):
                Robot(gone, ONCE)


def test_no_socket_here_stands_for_another_computer(folder: Path) -> None:
    with listen_locally(folder / "exo.sock"):
        assert [one.host for one in local_sockets(Address())] == [str(folder / "exo.sock")]
        assert not local_sockets(Address("192.0.2.7"))


@pytest.mark.parametrize(
    ("broken", "expected"),
    [("", "config/gwrms/exo-test.sock"), ("config", "run/gwrms/exo-test.sock"), ("all", None)],
)
def test_with_keys_there_is_a_socket_wherever_one_can_be(
    broken: str, expected: str | None, session: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    if broken:
        (tmp_path / "config").write_text("no folder")
    if broken == "all":
        (session / "gwrms").write_text("no folder")
    made = serve._local(config(keyed(tmp_path)))
    assert (made is None) == (expected is None)
    if made is not None:
        assert made.getsockname() == str(tmp_path / str(expected))
        made.close()
    else:
        assert "no Unix socket for this computer's accounts" in caplog.text


def test_two_gateways_of_one_name_both_have_their_socket(session: Path, tmp_path: Path) -> None:
    assert session.is_dir()
    robot = config(keyed(tmp_path))
    with contextlib.closing(serve._local(robot)) as one, contextlib.closing(serve._local(robot)) as other:  # type: ignore[type-var]
        assert one is not None
        assert other is not None
        assert one.getsockname() != other.getsockname()


def test_the_system_s_folder_comes_first_where_it_may_be_used(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Others than the gateway's own account reach it there only."""
    assert session.is_dir()
    monkeypatch.setattr(own_folders, "SYSTEM", tmp_path / "system" / "gwrms")
    (tmp_path / "system" / "gwrms").mkdir(parents=True)
    assert own_folders.to_serve_in(os.environ)[0] == tmp_path / "system" / "gwrms"
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert own_folders.to_serve_in(os.environ) == [tmp_path / "config" / "gwrms", session / "gwrms"]


def test_a_folder_that_others_may_write_to_is_made_safe_before_it_is_served_in(
    folder: Path, tmp_path: Path
) -> None:
    """As with a umask of 002: the socket was there, and no client believed it."""
    folder.mkdir(parents=True)
    folder.chmod(0o775)
    with contextlib.closing(serve._local(config(keyed(tmp_path)))) as made:  # type: ignore[type-var]
        assert made is not None
        assert Path(made.getsockname()).parent == folder
    assert folder.stat().st_mode & 0o777 == 0o755


def test_no_folder_that_another_user_has_made_is_served_in(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    made_by = session.stat().st_uid
    for folder in (tmp_path / "config" / "gwrms", session / "gwrms"):
        folder.mkdir(parents=True, exist_ok=True)
        folder.chmod(0o775)
    monkeypatch.setattr(own_folders, "ROOT", made_by + 2)
    monkeypatch.setattr(os, "geteuid", lambda: made_by + 1)
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert serve._local(config(keyed(tmp_path))) is None
    assert f"{session / 'gwrms'} is another user's" in caplog.text
    assert (session / "gwrms").stat().st_mode & 0o777 == 0o775, "nor is it changed"


def test_root_by_sudo_looks_where_the_user_s_own_gateway_is(
    session: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Path] = []
    monkeypatch.setattr(own_folders, "_is_safe", lambda folder, _: not asked.append(folder))  # type: ignore[func-returns-value]
    monkeypatch.setattr(Path, "is_dir", lambda self: str(self) == "/run/user/1234")
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    own_folders.to_look_in({"SUDO_UID": "1234", "XDG_RUNTIME_DIR": str(session)})
    assert [asked[1], asked[3]] == [session / "gwrms", Path("/run/user/1234/gwrms")]
