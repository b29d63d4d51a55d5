"""The `gwrms` command itself, whatever it is started with."""

import os
import shlex
import subprocess
import sys

import pytest

from gateway.main import main as run
from tests.fake_robot import FakeRobot

GWRMS = (sys.executable, "-m", "gateway.main")


@pytest.mark.parametrize("closed", [">&-", "<&-", "2>&-", "<&- >&- 2>&-"])
def test_a_stop_goes_out_and_counts_whatever_stream_is_closed(closed: str) -> None:
    with FakeRobot() as robot:
        command = f"{shlex.join(GWRMS)} stop --robot {robot.address} {closed}"
        ended = subprocess.run(["bash", "-c", command], capture_output=True, timeout=300, check=False)
        assert (ended.returncode, ended.stderr) == (0, b"")
        assert len(robot.called("robot.stop")) == 1


@pytest.mark.parametrize("command", ["describe --robot 127.0.0.1:1 --json", "--help", "describe --help"])
def test_a_reader_that_has_left_is_no_mistake_of_ours(command: str) -> None:
    left, ours = os.pipe()
    os.close(left)
    try:
        words = [*GWRMS, *command.split()]
        ended = subprocess.run(
            words, stdout=ours, stderr=subprocess.PIPE, text=True, timeout=300, check=False
        )
    finally:
        os.close(ours)
    assert "Traceback" not in ended.stderr
    assert "Exception ignored" not in ended.stderr


def test_ctrl_c_while_the_command_still_loads_ends_it_without_a_traceback() -> None:
    pressed = """
import sys
class CtrlC:
    def find_spec(self, name, path, target=None):
        if name == "gateway.main":
            raise KeyboardInterrupt
sys.meta_path.insert(0, CtrlC())
from gwrms.command import main
sys.exit(main())
"""
    ended = subprocess.run(
        [sys.executable, "-c", pressed], capture_output=True, text=True, timeout=300, check=False
    )
    assert (ended.returncode, ended.stderr) == (130, "")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["params", "--robot", "127.0.0.1:1", "save"], "options come behind the COMMAND"),
        (["journal", "tial"], "there is no command 'tial'; did you mean tail?"),
    ],
)
def test_one_of_several_commands_that_is_not_there_is_named(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words) == 2
    assert capsys.readouterr().err.splitlines()[-1] == said


def test_one_of_several_commands_that_is_not_given_only_shows_which_there_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["journal"]) == 2
    assert "there is no command" not in capsys.readouterr().err
