"""The client by TLS: to the robot that was paired and to no other, and never by another way."""

import contextlib
import shutil
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.client import (
    Address,
    BadAddress,
    LinkLost,
    LinkSettings,
    NotPaired,
    Robot,
    Unreachable,
    WrongRobot,
)
from gateway.client.keys import keys_folder, named, pin_of, server_file
from gateway.client.pairing import pin
from gateway.main import main
from tests.unit.gateway import keyed as keys
from tests.unit.gateway.harness import Bench, config, serving
from tests.unit.gateway.keyed import keyed

ONCE = LinkSettings(client="test", reconnect=False)


@pytest.fixture
def address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Address]:
    """Of a robot that knows the desk as an operator; the desk has not pinned it."""
    bench = Bench()
    monkeypatch.setattr("gateway.modules.component.module.assemble", bench.assemble)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "desk"))
    keys_folder().mkdir(parents=True)
    keys_folder().chmod(0o700)
    for file, name in zip(keys.pair("operator"), ("desk.key", "desk.crt"), strict=True):
        shutil.copy(file, keys_folder() / name)
    with serving(config(keyed(tmp_path))) as (host, port):
        yield Address(host, port)


def pinned(address: Address, name: str = keys.ROBOT) -> Address:
    return Address(address.host, address.port, keys.pin(name))


def test_a_robot_in_the_server_s_file_is_reached_by_its_address_alone(address: Address) -> None:
    pin("exo-test", pinned(address))
    with Robot(str(address), ONCE) as robot:
        assert robot.write({"gait.step_length": 0.42}).after == {"gait.step_length": 0.42}
        assert robot.stop("enough").held
        batch = next(robot.watch("left_knee.position", rate_hz=100))
        assert "left_knee.position" in batch.columns


def test_another_key_than_the_pinned_one_is_refused_loudly_and_told_nothing(address: Address) -> None:
    with pytest.raises(WrongRobot, match="ANOTHER ROBOT ANSWERS"):
        Robot(pinned(address, "impostor"), ONCE)


@pytest.mark.usefixtures("address")
def test_an_unknown_host_is_said_in_words() -> None:
    with pytest.raises(Unreachable, match="no gateway at"):
        Robot(pinned(Address("no-such-host.invalid", 7420)), ONCE)


def test_a_desk_whose_key_is_not_known_is_told_to_pair(address: Address, tmp_path: Path) -> None:
    (tmp_path / "clients" / "operator.crt").unlink()
    with pytest.raises(NotPaired, match="gwrms keys pair on the robot"):
        Robot(pinned(address), ONCE)


def test_a_desk_that_has_not_paired_is_told_so(address: Address) -> None:
    with pytest.raises(LinkLost, match="gwrms pair"):
        Robot(address, ONCE)


def test_a_desk_without_its_key_says_where_it_should_be(address: Address) -> None:
    (keys_folder() / "desk.key").unlink()
    with pytest.raises(NotPaired, match=str(keys_folder())):
        Robot(pinned(address), ONCE)


def test_a_robot_that_is_pinned_is_never_spoken_to_in_plain(address: Address) -> None:
    heard: list[bytes] = []

    def hear(listener: socket.socket) -> None:
        connection, _ = listener.accept()
        with connection, contextlib.suppress(OSError):
            heard.append(connection.recv(4096))
            connection.sendall(b'{"jsonrpc":"2.0","id":1,"result":{}}\n')

    with socket.create_server(("127.0.0.1", 0)) as listener:
        hearing = threading.Thread(target=hear, args=(listener,))
        hearing.start()
        with pytest.raises(Unreachable, match="Nothing was sent"):
            Robot(Address("127.0.0.1", listener.getsockname()[1], keys.pin(keys.ROBOT)), ONCE)
        hearing.join()
    assert b"hello" not in heard[0]


def test_pins_that_cannot_be_read_are_no_robot_without_a_pin(address: Address) -> None:
    server_file().write_text("[robots\n")
    with pytest.raises(NotPaired, match="cannot be read"):
        Robot("192.0.2.7:7420", ONCE)
    with pytest.raises(LinkLost):  # on this computer a stop must come through; this robot takes none so
        Robot(str(address), ONCE)


def test_a_unix_socket_is_an_address(tmp_path: Path) -> None:
    found = Address.parse(f"{tmp_path}/exo.sock")
    assert (found.path, str(found)) == (f"{tmp_path}/exo.sock", f"{tmp_path}/exo.sock")
    with pytest.raises(Unreachable, match=r"no gateway at .*exo\.sock"):
        Robot(found, ONCE)


@pytest.mark.parametrize("host", ["192.0.2.7", "exo.local", "localhost.example", "127.example", "::1:2"])
def test_to_another_computer_nothing_is_said_in_plain(
    host: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor under another name of a robot that is paired: whoever answers there could be anybody."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    pin("exo", Address("192.0.2.8", 7420, "a" * 64))
    with pytest.raises(NotPaired, match="only spoken to encrypted"):
        pin_of(Address(host, 7420))
    assert [pin_of(Address(here, 7420)) for here in ("127.0.0.1", "localhost", "::1")] == [None] * 3


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The server's file of a user, to be written to."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    server_file().parent.mkdir()
    return server_file()


def test_two_robots_at_one_address_each_have_their_own_pin(file: Path) -> None:
    """As behind one forwarded port, one today and another tomorrow: the first one's pin was asked of both."""
    file.write_text(
        "[robots]\n"
        f'exo-1 = {{ address = "127.0.0.1:7420", pin = "{"a" * 64}" }}\n'
        f'exo-2 = {{ address = "127.0.0.1:7420", pin = "{"B" * 64}" }}\n'
        'exo-3 = { address = "192.0.2.7" }\n'
        'exo-4 = "192.0.2.8:7421"\n'
    )
    found = {name: named(name) for name in ("exo-1", "exo-2", "exo-3", "exo-4", "exo-5")}
    assert found["exo-1"] is not None
    assert found["exo-2"] is not None
    assert (pin_of(found["exo-1"]), pin_of(found["exo-2"])) == ("a" * 64, "b" * 64)
    assert (found["exo-3"], found["exo-4"]) == (Address("192.0.2.7"), Address("192.0.2.8", 7421))
    assert found["exo-5"] is None


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        (f'{{ address = "127.0.0.1:7420", pin = "{"a" * 63}" }}', "64 hexadecimal digits"),
        ('{ address = "127.0.0.1:7420", pin = 7 }', "64 hexadecimal digits"),
        ('{ address = "127.0.0.1:99999" }', "a port from 1 to 65535"),
        ('"127.0.0.1:99999"', "a port from 1 to 65535"),
        (f'{{ pin = "{"a" * 64}" }}', "an address is missing"),
        ("7420", "an address is missing"),
    ],
)
def test_a_robot_whose_entry_cannot_be_used_is_no_host_of_that_name(
    file: Path, entry: str, why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file.write_text(f"[robots]\nexo-1 = {entry}\n")
    with pytest.raises(BadAddress, match=rf"exo-1 stands in .* of {file} and cannot be used: .*{why}"):
        named("exo-1")
    with pytest.raises(SystemExit):
        main(["stop", "--robot", "exo-1"])
    said = capsys.readouterr().err
    assert f"argument --robot: exo-1 stands in [robots] of {file}" in said
    assert "no gateway" not in said
