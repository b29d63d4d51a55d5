"""A drive homes by `gwrms commission`; whatever ends that leaves the joint at rest and without power."""

import json
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from gateway.commission.draft import Draft
from hil_sim.drive.power_state import ENERGISED
from hil_sim.exoskeleton import Scenario
from hil_sim.robot import SimulatedRobot
from tests.support.waiting import until

KNEE, NODE = "left_knee", 2
ENDS = [-1.0, 2.0]  # rad, by hand: the switch at -58° is between them
KNOWN: Mapping[str, Mapping[str, Any]] = {
    "robot": {"name": "exo-01", "joints": [KNEE]},
    "gateway": {"role": "master"},
    f"node.{NODE}": {"eds": "joint_drive.eds", "heartbeat": 100},
    f"joint.{KNEE}": {
        "node_id": NODE,
        "axis": 0,
        "configure_pdos": False,
        "counts_per_revolution": 4096.0,
        "gear_ratio": 100.0,
        "direction": 1,
        "zero_offset": 0.0,
    },
    f"told.{KNEE}": {"ends": ENDS, "rated_current": 5.0, "rated_torque": 40.0},
    f"guard.rule.{KNEE}_range": {"min": -0.95, "max": 1.95},
}
ANSWERS = {"Are these all": "all", "is to get power": "", "Type  home": f"home {KNEE}", "Write this": "y"}


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimulatedRobot]:
    folder = tmp_path_factory.mktemp("homing")
    with SimulatedRobot(folder / "sim", Scenario.STAND, without=["gait"]) as robot:
        yield robot


@contextmanager
def commissioning(file: Path, robot: SimulatedRobot) -> "Iterator[subprocess.Popen[str]]":
    draft = Draft(file)
    for table, keys in KNOWN.items():
        for key, value in keys.items():
            draft.put(table, key, value)
    command = [sys.executable, "-P", "-m", "gateway.main", "commission", str(file)]
    with subprocess.Popen(
        [*command, str(robot.config), "--json"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def said(process: "subprocess.Popen[str]") -> Iterator[dict[str, Any]]:
    assert process.stdout is not None
    yield from map(json.loads, process.stdout)


def typed(process: "subprocess.Popen[str]", text: str) -> None:
    assert process.stdin is not None
    process.stdin.write(text + "\n")
    process.stdin.flush()


def answer(process: "subprocess.Popen[str]", question: str, more: Mapping[str, str]) -> None:
    found = (reply for words, reply in {**ANSWERS, **more}.items() if words in question)
    typed(process, next(found, ""))


def moving(process: "subprocess.Popen[str]", method: int) -> None:
    """Until the joint is on its way."""
    for one in said(process):
        if "ask" in one:
            answer(process, one["ask"], {"find its own zero": str(method)})
        elif "looks for home" in (one.get("moving") or "") and "(+0.0°)" not in one["moving"]:
            return
    raise AssertionError(process.communicate())


def at_rest(robot: SimulatedRobot) -> bool:
    drive = robot.exoskeleton.drives[KNEE]
    return drive.power_state not in ENERGISED and abs(drive.joint.velocity) < 1e-3


def test_at_the_present_position_nothing_moves_and_the_zero_is_in_the_file(
    robot: SimulatedRobot, tmp_path: Path
) -> None:
    drive, file = robot.exoskeleton.drives[KNEE], tmp_path / "exo-01.toml"
    before = drive.joint.position
    with commissioning(file, robot) as process:
        read = []
        for one in said(process):
            read.append(one)
            if "ask" in one:
                answer(process, one["ask"], {"find its own zero": "37"})
        assert process.wait() == 0, read
    assert any("moving" in one for one in read)
    assert {"moving": None} in read
    assert at_rest(robot)
    assert drive.joint.position == pytest.approx(before, abs=1e-3)
    text = file.read_text(encoding="utf-8")
    zero = tomllib.loads(text)["joint"][KNEE]["zero_offset"]
    assert zero == pytest.approx(before, abs=1e-3), "the drive counts 0 there now"
    assert "after homing by method 37" in text


def enter(process: "subprocess.Popen[str]") -> None:
    typed(process, "")


def end_of_input(process: "subprocess.Popen[str]") -> None:
    assert process.stdin is not None
    process.stdin.close()


def signalled(number: signal.Signals) -> "Callable[[subprocess.Popen[str]], None]":
    return lambda process: process.send_signal(number)


@pytest.mark.parametrize(
    "end",
    [
        signalled(signal.SIGKILL),
        *(
            pytest.param(one, marks=pytest.mark.nightly)
            for one in (
                enter,
                end_of_input,
                signalled(signal.SIGTERM),
                signalled(signal.SIGHUP),
                signalled(signal.SIGINT),
                signalled(signal.SIGSTOP),
            )
        ),
    ],
)
def test_whoever_goes_leaves_it_at_rest_and_without_power(
    robot: SimulatedRobot, tmp_path: Path, end: "Callable[[subprocess.Popen[str]], None]"
) -> None:
    file = tmp_path / "exo-01.toml"
    with commissioning(file, robot) as process:
        moving(process, 17)
        assert not at_rest(robot)
        end(process)
        until(lambda: at_rest(robot))
    assert "zero_offset" not in Draft(file).tables[f"joint.{KNEE}"], "its zero may be another now"
