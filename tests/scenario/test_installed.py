"""The wheel as it is installed: in environments with the packages of one extra each."""

import os
import subprocess
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests.support.extras import ROOT, brought
from tests.support.installed import build, install
from tests.support.waiting import until

WITHIN_S = 120.0


class Environment:
    """A virtual environment with GWRMS from the wheel, and the packages of an extra."""

    def __init__(self, folder: Path, wheel: Path, extra: str | None) -> None:
        self.home = folder / "home"
        self.home.mkdir(parents=True)
        self._bin = install(wheel, brought(extra), folder / "env")
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "XDG_"))}
        self._environment = kept | {"HOME": str(self.home), "PATH": f"{self._bin}:/usr/bin:/bin"}

    def run(self, *words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [self._bin / words[0], *words[1:]],
            cwd=self.home,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=WITHIN_S,
            check=False,
        )

    def start(self, *words: str) -> "subprocess.Popen[bytes]":
        with (self.home / f"{words[1]}.log").open("wb") as said:
            return subprocess.Popen(
                [self._bin / words[0], *words[1:]],
                cwd=self.home,
                env=self._environment,
                stdout=said,
                stderr=said,
            )

    def said(self, name: str) -> str:
        return (self.home / f"{name}.log").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist, and the wheel that was made from it."""
    folder, unpacked = tmp_path_factory.mktemp("dist"), tmp_path_factory.mktemp("sdist")
    with tarfile.open(build("sdist", ROOT, folder)) as archive:
        archive.extractall(unpacked, filter="data")
    (source,) = unpacked.iterdir()
    build("wheel", source, folder)
    return folder


@pytest.fixture(scope="module")
def wheel(built: Path) -> Path:
    return next(built.glob("*.whl"))


def test_the_sdist_makes_the_same_wheel(built: Path, wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(build("wheel", ROOT, tmp_path)) as ours, zipfile.ZipFile(wheel) as made:
        assert set(made.namelist()) == set(ours.namelist())


def test_a_robot_is_served_checked_and_asked_with_five_packages(wheel: Path, tmp_path: Path) -> None:
    robot = Environment(tmp_path, wheel, None)
    (robot.home / "server.toml").write_text('[robots]\nexo-01 = "192.0.2.7:7420"\n')
    checked = robot.run("gwrms", "check", "server.toml")
    assert checked.returncode == 0, checked.stdout + checked.stderr
    page = robot.run("gwrms", "docs", "predict")
    assert page.stdout.startswith("# Predict")
    listed = robot.run("gwrms", "sim", "run", "nod_lost")
    assert "did you mean 'node_lost'" in listed.stderr
    simulator = robot.start("gwrms", "sim", "--dir", "robot", "--scenario", "stand")
    gateway = None
    try:
        until(lambda: "ready" in robot.said("sim"), within_s=WITHIN_S)
        assert robot.run("gwrms", "check", "robot/robot.toml").returncode == 0
        gateway = robot.start("gwrms", "gateway", "robot/robot.toml", "--port", "0")
        until(lambda: "listening on" in robot.said("gateway"), within_s=WITHIN_S)
        address = robot.said("gateway").split()[-1]
        described = robot.run("gwrms", "describe", "--robot", address)
        assert described.returncode == 0, described.stderr
        assert "left_knee" in described.stdout
        script = "import sys, gwrms\nwith gwrms.Robot(sys.argv[1]) as robot: print(robot.read('gait.*'))"
        assert "gait.step_length" in robot.run("python", "-c", script, address).stdout
    finally:
        for process in filter(None, (gateway, simulator)):
            process.terminate()
            process.wait(WITHIN_S)
    missing = robot.run("gwrms", "demo", "--headless", "--seconds", "1")
    assert "pip install 'gwrms[sim]'" in missing.stderr


def test_the_demo_runs_with_its_extra(wheel: Path, tmp_path: Path) -> None:
    done = Environment(tmp_path, wheel, "sim").run("gwrms", "demo", "--headless", "--seconds", "10")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "The joints moved, the feet alternated" in done.stdout
