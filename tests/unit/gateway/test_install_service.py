"""`gwrms install-service`: units that systemd itself finds right, and what cannot work refused in words."""

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from gateway.cli import install_service
from gateway.cli.systemd_units import MARK, NotForUnits, Service, folder
from gateway.config import load
from gateway.connections.listeners import listen
from gateway.main import main
from tests.support.waiting import WAIT_S
from tests.unit.gateway import processes

ON_DEMAND = """
[robot]
name = "exo 01 100%"
[gateway]
host = "127.0.0.1"
port = {port}
"""
GUARD = """
[insole.left_insole]
port = "/dev/null-left"
[guard.rule.silent]
watch = "insole_stale"
actions = ["alarm"]
"""
Units = Callable[..., dict[str, str]]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = tmp_path / "the robot.toml"
    with listen("127.0.0.1", 0) as free:
        file.write_text(ON_DEMAND.format(port=free.getsockname()[1]), encoding="utf-8")
    return file


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where units of the user go."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config" / "systemd" / "user"


def add(file: Path, text: str) -> None:
    file.write_text(file.read_text(encoding="utf-8") + text, encoding="utf-8")


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
@pytest.mark.parametrize("more", ["", "classic_port = 7421\n", 'records = "records"\n', GUARD])
@pytest.mark.parametrize("of_user", [False, True])
def test_systemd_itself_finds_nothing_wrong(file: Path, tmp_path: Path, more: str, *, of_user: bool) -> None:
    add(file, more)
    units = Service(load(file), of_user=of_user, user=None if of_user else "daemon").units
    for name, text in units.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    session = ["--user"] if of_user else ["--system"]
    checked = subprocess.run(
        ["systemd-analyze", *session, "verify", "--man=no", *(str(tmp_path / name) for name in units)],
        capture_output=True,
        text=True,
        check=False,
        timeout=WAIT_S,
        env={**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)},
    )
    assert (checked.returncode, checked.stdout + checked.stderr) == (0, "")


def test_without_a_guard_systemd_listens_and_with_one_it_runs_from_boot_on(file: Path) -> None:
    on_demand = Service(load(file))
    assert list(on_demand.units) == ["gwrms.socket", "gwrms.path", "gwrms.service"]
    assert on_demand.enabled == ["gwrms.socket", "gwrms.path"]
    assert "[Install]" not in on_demand.units["gwrms.service"]
    add(file, GUARD)
    at_boot = Service(load(file))
    assert list(at_boot.units) == at_boot.enabled == ["gwrms.service"]
    for said in ("Restart=on-failure", "WatchdogSec=10", "WantedBy=multi-user.target", "Type=notify"):
        assert said in at_boot.units["gwrms.service"]


def test_what_is_left_unfinished_starts_it_where_the_service_keeps_it(file: Path) -> None:
    paths = Service(load(file)).units["gwrms.path"]
    assert "PathExists=/var/lib/gwrms/exo_01_100_/stop.json" in paths
    assert "PathExists=/var/lib/gwrms/exo_01_100_/undo.json" in paths
    mine = Service(load(file), of_user=True)
    assert "ListenStream=%t/gwrms/gwrms.sock\n" in mine.units["gwrms.socket"]
    assert f"PathExists={load(file).records}/stop.json" in mine.units["gwrms.path"]


def test_the_command_in_the_unit_serves_the_file(file: Path) -> None:
    unit = Service(load(file)).units["gwrms.service"]
    command = re.findall(r"^ExecStart=(.*)$", unit, re.MULTILINE)[0]
    with processes.process(*shlex.split(command)) as running:
        assert processes.address(running)[1] == load(file).gateway.port


def test_it_is_written_for_the_user_and_says_what_to_do(
    file: Path, written: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["install-service", "--user", str(file)]) == 0
    said = capsys.readouterr().out
    assert {one.name for one in written.iterdir()} == {"gwrms.socket", "gwrms.path", "gwrms.service"}
    assert "systemctl --user enable --now gwrms.socket gwrms.path\n" in said
    add(file, GUARD)
    assert main(["install-service", "--user", str(file)]) == 0
    said = capsys.readouterr().out
    assert "systemctl --user disable --now gwrms.path gwrms.socket\n" in said
    assert "systemctl --user enable --now gwrms.service\n" in said


def test_print_writes_nothing(file: Path, written: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["install-service", "--user", "--print", str(file)]) == 0
    assert capsys.readouterr().out.count(MARK) == 3
    assert not written.exists()


def test_a_unit_of_somebody_else_is_not_touched(
    file: Path, written: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written.mkdir(parents=True)
    theirs = written / "gwrms.service"
    theirs.write_text("[Service]\n", encoding="utf-8")
    assert main(["install-service", "--user", str(file)]) == 1
    assert "was not written by gwrms" in capsys.readouterr().err
    assert [one.name for one in written.iterdir()] == ["gwrms.service"]
    assert theirs.read_text(encoding="utf-8") == "[Service]\n"


@pytest.mark.parametrize(
    ("old", "new", "arguments", "says"),
    [
        ("port = ", "port = 0 #", ["--user"], "port 0 is another one at each start"),
        ("127.0.0.1", "localhost", ["--user"], "systemd listens on addresses only"),
        ("[gateway]", "[gateway]\nlinger_s = 0", ["--user"], "give linger_s at least 2"),
        ("", "", ["--user", "--run-as", "me"], "with --user it is you"),
        ("", "", [], "a service has a /tmp of its own"),
    ],
)
def test_what_would_not_work_is_refused_in_words(
    file: Path,
    old: str,
    new: str,
    arguments: list[str],
    says: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file.write_text(file.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")
    monkeypatch.setattr(install_service, "PRIVATE", (file.parent,))
    assert main(["install-service", "--print", *arguments, str(file)]) == 1
    assert says in capsys.readouterr().err


def test_records_of_its_own_need_an_account_that_stays(
    file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    add(file, 'records = "records"\n')
    monkeypatch.setattr(install_service, "PRIVATE", ())
    assert main(["install-service", "--print", str(file)]) == 1
    assert "--run-as" in capsys.readouterr().err
    assert main(["install-service", "--print", "--run-as", "robot", str(file)]) == 0
    unit = capsys.readouterr().out
    assert "User=robot\n" in unit
    assert f"ReadWritePaths=-{file.parent}/records\n" in unit


def test_wrong_usage_ends_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["install-service"]) == 2
    assert main(["install-service", "robot.toml", "--name", "a/b"]) == 2
    assert "is no unit's name" in capsys.readouterr().err


def test_the_computer_s_units_go_where_systemd_looks() -> None:
    assert folder(of_user=False) == Path("/etc/systemd/system")


BREAK = "x\nExecStartPre=/bin/evil"


@pytest.mark.parametrize("host", [f"fe80::1%{BREAK}", BREAK, "%h", "a b", "", "::1%%eth0", "1.2.3.4\\"])
def test_a_host_that_says_more_than_a_host_is_refused(file: Path, host: str) -> None:
    config = load(file)
    gateway = msgspec.structs.replace(config.gateway, host=host)
    with pytest.raises(NotForUnits, match=r"host in .* cannot stand in a systemd unit"):
        Service(msgspec.structs.replace(config, gateway=gateway))


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "fe80::1", "0.0.0.0", "robot-1.lab", "::ffff:1.2.3.4"])
def test_a_host_that_is_one_stands_in_the_unit(file: Path, host: str) -> None:
    config = load(file)
    gateway = msgspec.structs.replace(config.gateway, host=host)
    units = Service(msgspec.structs.replace(config, gateway=gateway)).units
    assert host in units["gwrms.socket"]


@pytest.mark.parametrize("user", [f"ada\n{BREAK}", "ada ", "%u", "-ada", "a/b", "", "x" * 40])
def test_an_account_that_says_more_than_one_is_refused(file: Path, user: str) -> None:
    with pytest.raises(NotForUnits, match="the account cannot stand"):
        Service(load(file), user=user)


@pytest.mark.parametrize("name", ["a/b", BREAK, "", "../x", "a.service"])
def test_a_unit_name_that_is_a_path_is_refused(file: Path, name: str) -> None:
    with pytest.raises(NotForUnits, match="the units' name cannot stand"):
        Service(load(file), name)


@pytest.mark.parametrize("name", ["folder\nExecStartPre=x", "back\\slash", "esc\x1b[2J"])
def test_a_path_with_a_line_end_is_refused(file: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    moved = file.rename(tmp_path / name / "robot.toml")
    with pytest.raises(NotForUnits, match="the path cannot stand"):
        Service(load(moved))
    config = load(moved.rename(file))
    gateway = msgspec.structs.replace(config.gateway, records=str(tmp_path / name))
    with pytest.raises(NotForUnits, match="the path cannot stand"):
        Service(msgspec.structs.replace(config, gateway=gateway), user="ada")


@pytest.mark.parametrize("name", ["exo\x1b[2J", "exo\\"])
def test_a_robot_name_that_says_more_is_refused(file: Path, name: str) -> None:
    config = load(file)
    robot = msgspec.structs.replace(config.robot, name=name)
    with pytest.raises(NotForUnits, match=r"name in .* cannot stand"):
        Service(msgspec.structs.replace(config, robot=robot))
