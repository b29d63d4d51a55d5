"""Six unknown drives become a robot: commissioned from nothing, it walks, and the doctor is content."""

import json
import subprocess
import sys
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

import pytest

from gateway.client import Robot
from gateway.commission.dialogue import Ask
from hil_sim.exoskeleton import JOINTS
from server_gui.processes.children import Child
from tests.scenario.processes import gwrms, listening, nothing
from tests.support.waiting import WAIT_S, until
from tests.unit.commission.person import DRIVES, MOUNTINGS, Person, emergency_stop

pytestmark = pytest.mark.nightly  # it listens and watches for a minute

PORTS = ("right_insole", "left_insole", "trunk")
ROWS = 600  # at 100 Hz: some strides
NEAR_RAD = 0.01  # over strides: how late a value comes plays no part in it
LATE_RAD = 0.05
MOVES_RAD = 0.15


def unknown_robot(folder: Path) -> list[str]:
    """Three makers, shuffled ids, motors the other way round, zeros anywhere."""
    mounted = (f"{name}={one.node_id},{one.direction},{one.zero}" for name, one in MOUNTINGS.items())
    driven = (f"{name}={path.name}" for name, path in DRIVES.items())
    return [
        *("sim", "--dir", str(folder), "--scenario", "walk", "--truth", str(folder / "truth.jsonl")),
        *("--mistake", "none"),
        *(word for one in mounted for word in ("--mount", one)),
        *(word for one in driven for word in ("--drive", one)),
    ]


def ready(line: str) -> Mapping[str, Any] | None:
    said: dict[str, Any] = json.loads(line)
    return said if said.get("ready") else None


def commissioned(file: Path, folder: Path) -> int:
    """Answer `gwrms commission` as a person would; returns its exit status."""
    person = Person(folder)
    serial = [word for port in PORTS for word in ("--serial", str(folder / port))]
    command = [sys.executable, "-P", "-m", "gateway.main", "commission", str(file)]
    with subprocess.Popen(
        [*command, str(folder / "robot.toml"), *serial, "--json"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for said in map(json.loads, process.stdout):
            if "say" in said:
                person.say(said["say"])
            if "ask" not in said:
                continue  # its progress, and what drives tell
            question = Ask(said["ask"], tuple(said["choices"]), said["default"], said["unit"])
            process.stdin.write(person.ask(question) + "\n")
            process.stdin.flush()
    return process.returncode


@dataclass(frozen=True)
class Commissioned:
    """A robot's file, the simulator's folder, and the gateway that serves the one from the other."""

    file: Path
    folder: Path
    address: str


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Commissioned]:
    folder = tmp_path_factory.mktemp("unknown")
    file = tmp_path_factory.mktemp("robot") / "exo-01.toml"
    with ExitStack() as processes:
        patch = processes.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("XDG_STATE_HOME", str(file.parent / "state"))
        simulator = processes.enter_context(Child("simulator", unknown_robot(folder)))
        simulator.wait_ready(ready, WAIT_S, nothing)
        with emergency_stop(folder):
            assert commissioned(file, folder) == 0
        gateway = processes.enter_context(Child("gateway", ["gateway", str(file), "--port", "0"]))
        host, port = gateway.wait_ready(listening, WAIT_S, nothing)
        yield Commissioned(file, folder, f"{host}:{port}")


def test_its_file_passes_the_check(robot: Commissioned) -> None:
    done = gwrms("check", str(robot.file))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "controller" not in done.stdout + done.stderr, "what commands the drives was asked"


def test_it_walks_with_the_angles_that_its_joints_have(robot: Commissioned) -> None:
    names = [f"{joint}.position" for joint in JOINTS]
    with Robot(robot.address) as link:
        until(lambda: walks(link), lambda: link.components().values)
        stamps, angles = watched(link, names)
    real = truth(robot.folder)
    for name in names:
        moments = zip(stamps, angles[name], strict=True)
        off = [angle - real[nearest(real, stamp)][name] for stamp, angle in moments]
        assert max(angles[name]) - min(angles[name]) > MOVES_RAD, name
        assert abs(fmean(off)) < NEAR_RAD, name
        assert fmean(map(abs, off)) < LATE_RAD, name


def walks(link: Robot) -> bool:
    speed = link.components("left_knee.velocity").values["left_knee.velocity"]
    return speed is not None and abs(speed) > 1.0


def watched(link: Robot, names: Sequence[str]) -> tuple[list[int], dict[str, list[float]]]:
    """Some strides."""
    stamps: list[int] = []
    angles: dict[str, list[float]] = {name: [] for name in names}
    for batch in link.watch(*names, rate_hz=100):
        for stamp, row in batch.rows():
            found = {name: value for name, value in row.items() if value is not None}
            if len(found) == len(names):
                stamps.append(stamp)
                for name, value in found.items():
                    angles[name].append(value)
        if len(stamps) >= ROWS:
            break
    return stamps, angles


def truth(folder: Path) -> dict[int, Mapping[str, Any]]:
    """What was really so, by the computer's monotonic clock (ns), in its order."""
    head, *lines = (folder / "truth.jsonl").read_text(encoding="utf-8").splitlines()
    columns = json.loads(head)["columns"]
    rows = (dict(zip(columns, json.loads(line), strict=True)) for line in lines if line.endswith("]"))
    return {row["monotonic_ns"]: row for row in rows}


def nearest(real: Mapping[int, object], stamp: int) -> int:
    stamps = list(real)
    return stamps[min(bisect_left(stamps, stamp), len(stamps) - 1)]


def test_the_doctor_is_content_with_it(robot: Commissioned) -> None:
    computer = str(robot.folder / "computer")
    done = gwrms("doctor", str(robot.file), "--robot", robot.address, "--computer", computer, "--json")
    bill = json.loads(done.stdout)
    assert (done.returncode, bill["findings"], bill["not_judged"]) == (0, [], []), done.stdout
