"""`gwrms top` on a robot, in a terminal of its own."""

import os
import pty
import re
import select
import subprocess
import sys
import time

import pytest

from gateway.main import main
from tests.fake_robot import FakeRobot
from tests.support.waiting import WAIT_S


def test_without_a_terminal_it_says_what_needs_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["top"]) == 1
    assert "gwrms watch" in capsys.readouterr().err


def test_a_robot_is_shown_and_q_ends_it() -> None:
    ours, theirs = pty.openpty()
    with FakeRobot() as robot:
        command = [sys.executable, "-m", "gateway.main", "top", "--robot", robot.address]
        running = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs)
        os.close(theirs)
        try:
            _read_until(ours, "exo-fake.*left knee.*gait.step_length")
            os.write(ours, b"q")
            _read_until(ours, None)
            assert running.wait(WAIT_S) == 0
        finally:
            running.kill()
            running.wait()
            os.close(ours)


def test_a_stop_that_nobody_confirms_is_waited_for_and_is_an_error_at_the_end() -> None:
    ours, theirs = pty.openpty()
    with FakeRobot() as robot:
        command = [sys.executable, "-m", "gateway.main", "top", "--robot", robot.address]
        running = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=subprocess.PIPE)
        os.close(theirs)
        try:
            _read_until(ours, "exo-fake.*left knee.*gait.step_length")
            robot.mute = True
            os.write(ours, b"sq")
            _read_until(ours, "STOP sent")
            robot.cut()
            _read_until(ours, None)
            _, told = running.communicate(timeout=WAIT_S)
        finally:
            running.kill()
            running.wait()
            os.close(ours)
    assert running.returncode == 1
    assert told.startswith(b"gwrms top: STOP NOT CONFIRMED: ")


def _read_until(terminal: int, pattern: str | None) -> None:
    """Read what is shown until it has this, or until nobody shows anything any more."""
    shown, until_s = "", time.monotonic() + WAIT_S
    while time.monotonic() < until_s:
        if not select.select([terminal], [], [], 0.1)[0]:
            continue
        try:
            shown += os.read(terminal, 65536).decode(errors="replace")
        except OSError:  # the other end is closed
            assert pattern is None, shown
            return
        if pattern is not None and re.search(pattern, shown, re.DOTALL):
            return
    raise AssertionError(f"{pattern} was not shown: {shown[-2000:]}")
