"""However the command is ended, it says so, keeps what was found, and lets the file go."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.main import main

Process = subprocess.Popen[str]


def terminated(process: Process) -> None:
    process.send_signal(signal.SIGTERM)


def hung_up(process: Process) -> None:
    process.send_signal(signal.SIGHUP)


def nobody_there(process: Process) -> None:
    assert process.stdin is not None
    process.stdin.close()


def stopped(process: Process) -> None:
    assert process.stdin is not None
    process.stdin.write('{"stop": true}\n')
    process.stdin.flush()


@pytest.mark.parametrize(
    ("end", "status", "words"),
    [
        (terminated, 143, "interrupted"),
        (hung_up, 129, "interrupted"),
        (nobody_there, 1, "nobody answers any more"),
        (stopped, 1, "no drive is known yet; all 127 node ids were asked to stop"),
    ],
)
def test_a_question_that_waits_is_left_in_order(
    tmp_path: Path, end: Callable[[Process], None], status: int, words: str
) -> None:
    file = tmp_path / "exo-01.toml"
    command = [sys.executable, "-P", "-m", "gateway.main", "commission", "--json", str(file), "virtual:ends"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        for said in process.stdout:
            if "ask" in (line := _read(said)):
                break
        assert line["ask"].startswith("What is the robot called")
        end(process)
        rest = process.stdout.read()
    assert process.returncode == status, rest
    assert words in rest
    assert [one.name for one in tmp_path.iterdir()] == ["exo-01.toml.commission"]


def test_a_bus_that_is_not_there_is_said_before_anything_is_asked_and_leaves_no_file(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """It asked for the robot's name first, and left a draft with nothing found."""
    assert main(["commission", "--json", str(tmp_path / "exo-01.toml"), "socketcan:none9"]) == 1
    said = capfd.readouterr()
    assert "none9" in said.err
    assert "ask" not in said.out
    assert list(tmp_path.iterdir()) == []


def _read(said: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(said)
    return found
