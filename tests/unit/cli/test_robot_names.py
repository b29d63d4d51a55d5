"""A robot that is asked for by its name in server.toml is spoken of by that; and what a stop lists."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gateway.main import main
from tests.fake_robot import JOINTS, FakeRobot


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    with FakeRobot() as robot:
        yield robot


@pytest.fixture
def listed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[str], None]:
    """Put robots into the user's server.toml."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    (tmp_path / "gwrms").mkdir()

    def write(robots: str) -> None:
        (tmp_path / "gwrms" / "server.toml").write_text(f"[robots]\n{robots}", encoding="utf-8")

    return write


def test_a_stop_of_a_robot_by_its_name_says_and_advises_that_name(
    robot: FakeRobot, listed: Callable[[str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    listed(f'exo-01 = "{robot.address}"\nexo-02 = "192.0.2.7:7420"\n')
    assert main(["stop", "--robot", "exo-01"]) == 0
    assert "it is reset (gwrms reset --robot exo-01)" in capsys.readouterr().out
    assert main(["stop", "--robot", "exo-02"]) == 1
    said = capsys.readouterr().err
    assert "assume that exo-02 still moves. exo-02 (192.0.2.7:7420) is not paired" in said
    assert "use the address" not in said, "it was asked for by the name in that very file"


def test_a_name_that_no_robot_has_is_said_to_be_one(
    listed: Callable[[str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    """It was taken for a computer's, and pairing was advised."""
    listed('exo-01 = "192.0.2.7:7420"\n')
    assert main(["describe", "--robot", "exo01"]) == 1
    said = capsys.readouterr().err
    assert "no robot is called 'exo01' in " in said
    assert "; did you mean exo-01? If it is a computer: exo01:7420 is not paired" in said
    assert main(["describe", "--robot", "trainer"]) == 1
    assert "server.toml (it has exo-01). If it is" in capsys.readouterr().err


def test_a_name_in_other_capitals_is_said_in_one_short_sentence(
    listed: Callable[[str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    listed('exoskeleton = "192.0.2.7:7420"\nexo-02 = "192.0.2.8:7420"\n')
    assert main(["describe", "--robot", "EXOSKELETON"]) == 1
    said = capsys.readouterr().err
    assert said == "gwrms describe: no robot is called 'EXOSKELETON'; did you mean exoskeleton?\n"


def test_a_controller_is_not_listed_as_a_drive(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    answer: dict[str, object] = {"drives": dict.fromkeys(JOINTS, "confirmed"), "held": True}
    robot.overrides["robot.stop"] = lambda params: answer
    assert main(["stop", "--robot", robot.address]) == 0
    assert capsys.readouterr().out.startswith("DRIVE ")
    answer["controllers"] = {"gait": "confirmed"}
    assert main(["stop", "--robot", robot.address]) == 0
    assert capsys.readouterr().out.startswith("DRIVE OR CONTROLLER ")


def test_a_stop_by_an_outdated_file_is_not_confirmed(
    robot: FakeRobot, capsys: pytest.CaptureFixture[str]
) -> None:
    answer = {"drives": dict.fromkeys(JOINTS, "confirmed"), "held": True, "outdated": "robot.toml: is broken"}
    robot.overrides["robot.stop"] = lambda params: answer
    assert main(["stop", "--robot", robot.address]) == 1
    assert capsys.readouterr().err == "gwrms stop: robot.toml: is broken\n"
