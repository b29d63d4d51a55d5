"""`gwrms gateway` as a command: its manual, its exit status, its errors."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from gateway.cli import serve
from gateway.cli.serve import MOST_KEPT, NOT_KEPT, _parser, _robot
from gateway.connections.listeners import Listeners, listen
from gateway.main import main
from tests.unit.gateway.harness import ROBOT


def test_help_reads_like_a_manual(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["gateway", "--help"]) == 0
    text = capsys.readouterr().out
    assert all(
        part in text for part in ("CONFIG", "--host", "--port", "listening on HOST:PORT", "exit status")
    )


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "CONFIG"),
        (["robot.toml", "--port", "seven"], "'seven' is no port; allowed are 0 to 65535"),
        (["robot.toml", "--port", "65536"], "'65536' is no port"),
        (["robot.toml", "--prot", "1"], "--prot"),
    ],
)
def test_wrong_usage_ends_with_2(arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["gateway", *arguments]) == 2
    assert says in capsys.readouterr().err


def test_a_wrong_file_ends_with_1_and_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "robot.toml"
    file.write_text("[robot]\n", encoding="utf-8")
    assert main(["gateway", str(file)]) == 1
    assert capsys.readouterr().err == f"gwrms gateway: {file}: [robot] name: is missing\n"


def test_a_port_in_use_ends_with_1_and_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(ROBOT, encoding="utf-8")
    with listen("127.0.0.1", 0) as taken:
        assert main(["gateway", str(file), "--port", str(taken.getsockname()[1])]) == 1
    error = capsys.readouterr().err
    assert "cannot listen on 127.0.0.1:" in error
    assert f"Address already in use; choose another with [gateway] of {file}: host and port" in error
    assert "Traceback" not in error
    assert "Errno" not in error


def test_an_address_of_another_computer_is_named_with_file_and_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(ROBOT.replace("[gateway]", '[gateway]\nhost = "192.0.2.1"'), encoding="utf-8")
    assert main(["gateway", str(file)]) == 1
    error = capsys.readouterr().err
    assert "cannot listen on 192.0.2.1:" in error
    assert f"Cannot assign requested address; choose another with [gateway] of {file}: host" in error
    assert "Errno" not in error


@pytest.mark.parametrize("tell", [True, False])
def test_what_is_likely_wrong_with_its_file_is_logged_at_its_start_and_not_each_time_that_it_wakes(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, tell: bool
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text('[robot]\nname = "x"\n[gateway]\nhost = "0.0.0.0"\n', encoding="utf-8")
    _robot(_parser().parse_args([str(file)]), tell=tell)
    assert [record.getMessage().partition(" is open ")[0] for record in caplog.records] == (
        [f"{file}: [gateway] host: '0.0.0.0'"] if tell else []
    )


@pytest.mark.parametrize("tell", [True, False])
def test_a_device_s_file_that_cannot_be_used_is_logged_at_its_start(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, tell: bool
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(ROBOT.replace('eds = "joint_drive.eds"', 'eds = "joint_drve.eds"', 1), encoding="utf-8")
    robot, _kept = _robot(_parser().parse_args([str(file)]), tell=tell)
    assert "left_knee" in robot.joint
    said = [record.getMessage() for record in caplog.records]
    about = [one for one in said if one.startswith(f"{file}: [joint.left_knee]")]
    assert len(about) == int(tell)
    assert all(
        "there is no EDS file 'joint_drve.eds'" in one and "'joint_drive.eds'?" in one for one in about
    )


def test_a_file_too_large_to_be_kept_is_said_to_be(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = tmp_path / "robot.toml"
    name = '[robot]\nname = "x"\n#'
    for length, kept in ((MOST_KEPT, True), (MOST_KEPT + 1, False)):
        file.write_text(name.ljust(length), encoding="utf-8")
        _config, text = _robot(_parser().parse_args([str(file)]), tell=True)
        assert bool(text) is kept
        assert (NOT_KEPT % (file, MOST_KEPT) in caplog.messages) is not kept


def test_what_was_kept_and_is_not_valid_any_more_is_no_robot_and_is_kept_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another version of the program may have kept it, or may come back."""
    file, rested = tmp_path / "robot.toml", list[Mapping[str, str]]()
    file.write_text("[robot]\n", encoding="utf-8")
    monkeypatch.setattr(serve, "rest", lambda _listeners, kept: rested.append(kept))
    with listen("127.0.0.1", 0) as port:
        monkeypatch.setattr(serve, "inherited", lambda _environ: Listeners(port, woken=True))
        monkeypatch.setenv("GWRMS_VALID_FILE", "[robot]\nnme = 1")
        assert main(["gateway", str(file)]) == 1
    assert rested == [{"GWRMS_VALID_FILE": "[robot]\nnme = 1"}]
