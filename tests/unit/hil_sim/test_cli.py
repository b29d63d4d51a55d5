"""`gwrms sim` as a process."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from gateway.main import main as gwrms
from hil_sim.cli.sim import main
from hil_sim.robot import SimulatedRobot
from tests.support.waiting import WAIT_S


@contextmanager
def sim(folder: Path, *arguments: str) -> Iterator[tuple["subprocess.Popen[str]", Path]]:
    command = [sys.executable, "-m", "gateway.main", "sim", "--dir", str(folder), *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            ready = json.loads(process.stdout.readline())
            assert ready["ready"] is True
            yield process, Path(ready["config"])
        finally:
            process.kill()


def hub_port(folder: Path) -> int:
    return int((folder / "hub.port").read_text(encoding="ascii"))


def test_it_says_ready_and_ends_cleanly_on_sigterm(tmp_path: Path) -> None:
    with sim(tmp_path / "robot") as (process, config):
        assert config == tmp_path / "robot" / "robot.toml"
        assert config.is_file()
        socket.create_connection(("127.0.0.1", hub_port(config.parent)), timeout=WAIT_S).close()
        process.send_signal(signal.SIGTERM)
        assert process.wait(WAIT_S) == 0
    assert not (config.parent / "trunk").is_symlink()


def test_it_runs_as_long_as_it_is_told_and_simulates_more_than_it_computes(tmp_path: Path) -> None:
    """By the time it computes, not by the clock: a busy computer makes both later."""
    before_s = children_s()
    with sim(tmp_path, "--seconds", "5", "--scenario", "stand", "--speed", "max") as (process, _):
        assert process.wait(WAIT_S) == 0
    assert children_s() - before_s < 5


def children_s() -> float:
    """CPU time of ended children."""
    times = os.times()
    return times.children_user + times.children_system


def test_after_kill_9_the_same_folder_has_the_same_port_and_paths(tmp_path: Path) -> None:
    with sim(tmp_path) as (process, _):
        port = hub_port(tmp_path)
        client = socket.create_connection(("127.0.0.1", port), timeout=WAIT_S)
        assert client.recv(6) == b"< hi >"
        process.send_signal(signal.SIGKILL)
        process.wait(WAIT_S)
    assert (tmp_path / "trunk").is_symlink()
    with client, sim(tmp_path):
        assert hub_port(tmp_path) == port
        os.close(os.open(tmp_path / "trunk", os.O_RDWR | os.O_NOCTTY))


def test_a_second_simulator_in_the_folder_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with SimulatedRobot(tmp_path, virtual_channel=str(tmp_path)):
        assert gwrms(["sim", "--dir", str(tmp_path)]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.strip() == (
        f"gwrms sim: another simulator is running in {tmp_path}; stop it first, or choose another --dir"
    )


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["--dir"],
        ["--dir", "x", "--scenario", "fly"],
        ["--dir", "x", "--seconds", "-1"],
        ["--dir", "x", "--seed", "y"],
        ["--dir", "x", "--speed", "0"],
        ["--dir", "x", "--speed", "fast"],
    ],
)
def test_wrong_usage_is_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    assert "usage: gwrms sim" in capsys.readouterr().err


def test_help_reads_like_a_manual(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    for word in ("robot.toml", "walk", "sit", "2001h", "Exit status", "example"):
        assert word in text


def test_a_folder_that_cannot_be_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("", encoding="ascii")
    assert gwrms(["sim", "--dir", str(tmp_path / "file" / "robot")]) == 1
    assert str(tmp_path / "file" / "robot") in capsys.readouterr().err
