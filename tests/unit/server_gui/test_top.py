"""`gwrms top` on a robot, in a terminal of its own."""

import subprocess

import pytest

from gateway.main import main
from tests.fake_robot import FakeRobot
from tests.support.terminal import Terminal
from tests.support.waiting import WAIT_S


def test_without_a_terminal_it_says_what_needs_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["top"]) == 1
    assert "gwrms watch" in capsys.readouterr().err


def test_a_robot_is_shown_and_q_ends_it() -> None:
    with FakeRobot() as robot, Terminal("top", "--robot", robot.address) as terminal:
        terminal.read_until("exo-fake.*left knee.*gait.step_length")
        terminal.press(b"q")
        terminal.read_until(None)
        assert terminal.program.wait(WAIT_S) == 0


def test_a_stop_that_nobody_confirms_is_waited_for_and_is_an_error_at_the_end() -> None:
    with FakeRobot() as robot, Terminal("top", "--robot", robot.address, errors=subprocess.PIPE) as terminal:
        terminal.read_until("exo-fake.*left knee.*gait.step_length")
        robot.mute = True
        terminal.press(b"sq")
        terminal.read_until("STOP sent")
        robot.cut()
        terminal.read_until(None)
        _, told = terminal.program.communicate(timeout=WAIT_S)
    assert terminal.program.returncode == 1
    assert told.startswith(b"gwrms top: STOP NOT CONFIRMED: ")
