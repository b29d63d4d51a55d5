"""A desk lets a key in on further robots, over ssh: what fails is named, the others are done."""

import os
import shlex
import shutil
from pathlib import Path

import pytest

from gateway.access.folder import AccessFolder
from gateway.access.known_clients import known_in
from gateway.certificates import der_of, fingerprint
from gateway.client import Address
from gateway.client.keys import keys_folder, pin_of, server_file
from gateway.main import main
from gateway.wire.role import Role
from tests.unit.gateway import keyed as keys
from tests.unit.gateway import processes
from tests.unit.gateway.keyed import keyed

SSH = """#!/bin/sh
# Called as: ssh -T -- HOST COMMAND
case "$3" in
*gone) echo "ssh: connect to host $3 port 22: No route to host" >&2; exit 255 ;;
esac
echo "Welcome to $3"
exec sh -c "$4"
"""


@pytest.fixture
def by_ssh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A robot with keys that this desk logs in to; its file."""
    programs = tmp_path / "bin"
    programs.mkdir()
    (programs / "ssh").write_text(SSH)
    (programs / "ssh").chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "desk"))
    robot = tmp_path / "a robot"
    robot.mkdir()
    keyed(robot, {})
    (robot / "robot.toml").write_text('[robot]\nname = "exo-02"\n', encoding="utf-8")
    return robot / "robot.toml"


def push(file: Path, *more: str) -> int:
    remote = shlex.join(processes.GATEWAY[:-1])
    return main(["keys", "push", *more, "--config", str(file), "--remote", remote])


def test_a_desk_is_let_in_on_a_further_robot_and_pins_it(by_ssh: Path) -> None:
    assert push(by_ssh, "root@192.0.2.8", "--role", "operator", "--name", "anna") == 0
    (who,) = known_in(AccessFolder(by_ssh.parent, {})).by_key.values()
    own = der_of((keys_folder() / "desk.crt").read_bytes())
    assert (who.name, who.role, who.fingerprint) == ("anna", Role.OPERATOR, fingerprint(own))
    assert pin_of(Address("192.0.2.8", 7420)) == keys.pin(keys.ROBOT)


def test_of_many_robots_those_that_fail_are_named_and_the_others_done(
    by_ssh: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    somebody = str(keys.pair("bert")[1])
    assert push(by_ssh, "exo-gone", "exo-02", "exo-02", "--certificate", somebody, "--role", "viewer") == 1
    said = capsys.readouterr()
    assert "exo-02: exo-02 lets bert in from now on, as viewer." in said.out
    assert "exo-gone: ssh: connect to host" in said.err
    assert "bert is known already" in said.err
    assert not server_file().exists(), "another's robot is not pinned here"


@pytest.mark.parametrize(
    "more", [["-oProxyCommand=x"], ["exo-02", "--name", "../x"], ["exo-02", "--role", "root"]]
)
def test_what_is_no_host_name_or_role_reaches_no_ssh(by_ssh: Path, more: list[str]) -> None:
    with pytest.raises(SystemExit):
        push(by_ssh, "--role", "viewer", "--", *more[:1]) if more[0][0] == "-" else push(
            by_ssh, "--role", "viewer", *more
        )


def test_what_is_no_certificate_and_a_robot_without_keys_let_nobody_in(
    by_ssh: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert push(by_ssh, "exo-02", "--certificate", str(by_ssh), "--role", "viewer") == 1
    shutil.rmtree(by_ssh.parent / "keys")
    assert push(by_ssh, "exo-02", "--certificate", str(keys.pair("bert")[1]), "--role", "viewer") == 1
    assert "has no keys yet" in capsys.readouterr().err
    assert known_in(AccessFolder(by_ssh.parent, {})).by_key == {}
