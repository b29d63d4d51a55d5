"""What the README and the pages that it leads to show works as it stands there."""

import re
from pathlib import Path

import pytest

from gateway import config
from gateway.main import COMMANDS
from tests.fake_robot import FakeRobot
from tests.newcomer.pages import blocks

ROOT = Path(__file__).parents[3]
README = ROOT / "README.md"
SCRIPT = ROOT / "docs" / "how-to" / "write-a-script.md"
FIRST_ROBOT = ROOT / "docs" / "how-to" / "first-robot.md"


def block(page: Path, language: str) -> str:
    return next(one.text for one in blocks(page) if one.language == language)


def run(page: Path, address: str) -> None:
    exec(compile(block(page, "python").replace("127.0.0.1:7420", address), page.name, "exec"), {})


def test_script_of_five_lines_runs(capsys: pytest.CaptureFixture[str]) -> None:
    assert len(block(SCRIPT, "python").strip().partition("\n\n")[2].splitlines()) == 5
    with FakeRobot() as robot:
        run(SCRIPT, robot.address)
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "0.4"
    assert printed[2] == "{'gait.step_length': 0.42}"


def test_script_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    with FakeRobot() as robot:
        run(README, robot.address)
    assert capsys.readouterr().out == "{'gait.step_length': 0.42}\n"


def test_first_robot_is_a_file_that_the_gateway_takes(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(block(FIRST_ROBOT, "toml"), encoding="utf-8")
    robot = config.load(file)
    assert robot.robot.name == "exo-01"
    assert set(robot.joint) == {"left_knee"}


def test_every_command_that_is_named_exists() -> None:
    named = set(re.findall(r"(?<!from )gwrms ([a-z]+(?:-[a-z]+)*)", README.read_text(encoding="utf-8")))
    assert len(named) > 5
    assert named <= set(COMMANDS)


def test_the_readme_is_read_in_a_minute() -> None:
    assert len(README.read_text(encoding="utf-8").splitlines()) < 120
