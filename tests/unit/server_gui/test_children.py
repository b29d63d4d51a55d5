"""Child processes: ready, dead, deaf: each is noticed, and none is left behind."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from server_gui.cli.demo import demo
from server_gui.processes import children
from server_gui.processes.children import Child, ChildFailed
from server_gui.processes.shutdown_signals import ShutdownRequested, ShutdownSignals
from tests.support.waiting import WAIT_S, until


def nothing() -> None:
    pass


def anything(line: str) -> str | None:
    return line or None


def has_ended(process: psutil.Process) -> bool:
    try:
        return process.status() == psutil.STATUS_ZOMBIE  # where nobody waits for orphans
    except psutil.NoSuchProcess:
        return True


def test_first_words_are_found_and_the_child_is_ended() -> None:
    with Child("helper", ["--version"]) as child:
        assert child.wait_ready(anything, WAIT_S, nothing).startswith("gwrms ")
    assert not psutil.pid_exists(child.pid)


def test_child_that_ends_is_named_with_its_last_words() -> None:
    words = r"helper has ended \(exit status 2\)(.|\n)*no-such-command"
    with Child("helper", ["no-such-command"]) as child, pytest.raises(ChildFailed, match=words):
        child.wait_ready(anything, WAIT_S, nothing)


def test_child_that_is_killed_is_named_with_the_signal(tmp_path: Path) -> None:
    with Child("simulator", ["sim", "--dir", str(tmp_path)]) as child:
        child.wait_ready(anything, WAIT_S, nothing)
        child.check()
        os.kill(child.pid, signal.SIGKILL)
        with pytest.raises(ChildFailed, match="killed by SIGKILL"):
            until(lambda: child.check())


def test_child_that_never_says_that_it_is_ready_is_given_up(tmp_path: Path) -> None:
    simulator = Child("simulator", ["sim", "--dir", str(tmp_path)])
    with simulator as child, pytest.raises(ChildFailed, match="not ready after"):
        child.wait_ready(lambda line: None, 0.05, nothing)


def test_child_that_will_not_end_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(children, "END_S", 0.2)
    with Child("simulator", ["sim", "--dir", str(tmp_path)]) as child:
        child.wait_ready(anything, WAIT_S, nothing)
        os.kill(child.pid, signal.SIGSTOP)
    assert not psutil.pid_exists(child.pid)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_is_noticed_between_two_steps(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with ShutdownSignals() as ending:
        ending.check()
        os.kill(os.getpid(), number)
        with pytest.raises(ShutdownRequested) as ended:
            until(lambda: ending.check())
        assert ended.value.status == 128 + number
    assert signal.getsignal(number) is before


@pytest.mark.parametrize(
    "arguments", [["--seconds", "0"], ["--seconds", "x"], ["--scenario", "fly"], ["now"]]
)
def test_wrong_usage_is_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        demo(arguments)
    assert ended.value.code == 2
    assert "usage: gwrms demo" in capsys.readouterr().err


@pytest.mark.skipif(shutil.which("setpriv") is None, reason="util-linux's setpriv is not here")
def test_child_ends_where_its_parent_is_killed(tmp_path: Path) -> None:
    program = (
        "from server_gui.processes.children import Child\n"
        f"print(Child('simulator', ['sim', '--dir', {str(tmp_path)!r}]).pid, flush=True)\n"
        "input()"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", program],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert parent.stdin
    assert parent.stdout
    with parent.stdin, parent.stdout:
        simulator = psutil.Process(int(parent.stdout.readline()))
        until(lambda: (tmp_path / "robot.toml").exists())
        parent.kill()
        parent.wait()
    until(lambda: has_ended(simulator))
