"""Under a real X server: clicks and keys, and a STOP key while the window's own thread is held up."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.fake_robot import FakeRobot
from tests.support.waiting import WAIT_S, until

PROGRAM = Path(__file__).with_name("busy_window.py")
KEPT = Path(__file__).parents[1] / "data" / "window" / "maximised.conf"

pytestmark = [
    pytest.mark.skipif(
        not all(map(shutil.which, ("Xvfb", "xdotool"))), reason="needs apt-get install xvfb xauth xdotool"
    ),
]


@dataclass
class Shown:
    """A window on an X server, and the robot that it shows."""

    robot: FakeRobot
    folder: Path
    display: str
    window: str
    keys: str
    stop_at: tuple[str, str]

    def xdotool(self, *words: str) -> None:
        subprocess.run(
            ["xdotool", *words], env={**os.environ, "DISPLAY": self.display}, check=True, timeout=WAIT_S
        )

    def touch(self, name: str) -> None:
        (self.folder / name).touch()

    def click(self, name: str, *, times: int = 1) -> None:
        """Click what busy_window.py calls so, once it can be."""
        self.touch(f"{name}.where")
        until((self.folder / f"{name}.at").exists, f"could click {name}")
        x, y = (self.folder / f"{name}.at").read_text(encoding="utf-8").split()
        self.xdotool("mousemove", x, y, "click", "--repeat", str(times), "--delay", "60", "1")

    @property
    def stops(self) -> int:
        return len(self.robot.called("robot.stop"))


@contextmanager
def x_server(screen: str = "1400x900x24") -> Iterator[str]:
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", screen, "-nolisten", "tcp"],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    try:
        with os.fdopen(read) as said:
            yield f":{said.readline().strip()}"
    finally:
        server.terminate()
        server.wait(WAIT_S)


@pytest.fixture
def shown(tmp_path: Path) -> Iterator[Shown]:
    with FakeRobot() as robot, x_server() as display:
        environment = {**os.environ, "DISPLAY": display, "QT_QPA_PLATFORM": "xcb"}
        window = subprocess.Popen(
            [sys.executable, str(PROGRAM), robot.address, str(tmp_path)],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert window.stdout is not None
            _, keys, number, x, y = window.stdout.readline().split()
            made = Shown(robot, tmp_path, display, number, keys, (x, y))
            until(lambda: len(robot.called("stream.start")) > 0, "followed the robot")
            made.xdotool("windowfocus", "--sync", number)
            yield made
        finally:
            for name in ("free", "end"):
                (tmp_path / name).touch()
            try:
                window.wait(WAIT_S)
            finally:
                window.kill()
                window.wait()
                if window.stdout is not None:
                    window.stdout.close()


def test_keys_and_click_stop_also_while_the_window_is_held_up(shown: Shown) -> None:
    assert shown.keys == "x11"
    shown.xdotool("key", "F12")
    until(lambda: shown.stops == 1, "stopped by F12")
    shown.xdotool("key", "ctrl+space")
    until(lambda: shown.stops == 2, "stopped by Ctrl+Space")
    shown.xdotool("mousemove", *shown.stop_at, "click", "1")
    until(lambda: shown.stops == 3, "stopped by a click")
    time.sleep(0.3)  # a second press within 0.2 s is taken for a key that is held down
    shown.touch("hold")
    until(lambda: (shown.folder / "held").exists(), "held up")
    shown.xdotool("key", "F12")
    until(lambda: shown.stops == 4, "stopped while the window was held up")
    shown.xdotool("key", "shift+F12")
    until(lambda: shown.stops == 5, "stopped every robot likewise")
    reasons = [call["reason"] for call in shown.robot.called("robot.stop")]
    assert reasons[-2:] == ["STOP key of the window", "STOP ALL key of the window"]
    assert not (shown.folder / "free").exists(), "the window was not held up any more"


def test_a_value_is_edited_reviewed_and_written_with_mouse_and_keys(shown: Shown) -> None:
    until(lambda: len(shown.robot.called("parameter.read")) > 1, "read the parameters")
    shown.click("field", times=2)
    shown.xdotool("type", "430")
    shown.xdotool("key", "Return")
    shown.click("review")
    assert shown.robot.called("parameter.write") == [], "nothing is written before it was reviewed"
    shown.click("write")
    until(lambda: len(shown.robot.called("parameter.write")) == 1, "wrote it")
    assert shown.robot.called("parameter.write")[0]["changes"] == {"gait.step_length": 0.43}
    assert shown.robot.parameters["gait.step_length"] == 0.43


@pytest.mark.parametrize("scale", [100, 125, 200])
def test_a_window_that_was_maximised_opens_again_at_any_size_of_text(tmp_path: Path, scale: int) -> None:
    """Kept on a screen of 1366 × 768, where the panels do not fit: that was a segmentation fault."""
    kept = tmp_path / "gwrms" / "gui.conf"
    kept.parent.mkdir()
    shutil.copy(KEPT, kept)
    opened = (
        "from server_gui.app import run; from server_gui.core.settings.server_file import ServerSettings;"
        f"raise SystemExit(run(ServerSettings(), scale={scale / 100}, seconds=2.0))"
    )
    with x_server("1366x768x24") as display:
        environment = {
            **os.environ,
            "DISPLAY": display,
            "QT_QPA_PLATFORM": "xcb",
            "XDG_CONFIG_HOME": str(tmp_path),
        }
        ended = subprocess.run(
            [sys.executable, "-c", opened],
            env=environment,
            capture_output=True,
            text=True,
            timeout=WAIT_S,
            check=False,
        )
    assert ended.returncode == 0, ended.stderr
