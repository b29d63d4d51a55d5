"""What the README shows works as it stands there."""

import re
from pathlib import Path

import pytest

from gateway import config
from gateway.main import COMMANDS
from tests.fake_robot import FakeRobot

README = Path(__file__).parents[3] / "README.md"


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return found[1]


def test_script_of_five_lines_runs(capsys: pytest.CaptureFixture[str]) -> None:
    script = block("python")
    assert len(script.strip().partition("\n\n")[2].splitlines()) == 5
    with FakeRobot() as robot:
        exec(compile(script.replace("127.0.0.1:7420", robot.address), "README.md", "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "0.4"
    assert printed[2] == "{'gait.step_length': 0.42}"


def test_first_robot_is_a_file_that_the_gateway_takes(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(block("toml"), encoding="utf-8")
    robot = config.load(file)
    assert robot.robot.name == "exo-01"
    assert set(robot.joint) == {"left_knee"}


def test_every_command_that_is_named_exists() -> None:
    named = set(re.findall(r"gwrms ([a-z]+(?:-[a-z]+)*)", README.read_text(encoding="utf-8")))
    assert len(named) > 5
    assert named <= set(COMMANDS)


def test_every_link_leads_somewhere() -> None:
    links = re.findall(r"\]\(([^)#:]+)\)", README.read_text(encoding="utf-8"))
    assert [link for link in links if not (README.parent / link).exists()] == []
