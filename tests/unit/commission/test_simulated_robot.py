"""A robot of unknown drives is commissioned by somebody who only reads, moves joints by hand and types."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from drivers.bus.settings import CanSettings
from drivers.scan.products import Library, files
from eds.shipped import SHIPPED
from gateway.commission.bench import CanBench
from gateway.commission.dialogue import Ask, run
from gateway.commission.draft import Draft
from gateway.commission.serial_bench import SerialPorts
from gateway.commission.steps import commission
from gateway.commission.writing import text
from gateway.config.reading import examine
from hil_sim.control_socket import ask
from hil_sim.exoskeleton import JOINTS, Scenario
from hil_sim.mounting import Mounting
from hil_sim.robot import SimulatedRobot

CHANNEL = "commission"
SETTINGS = CanSettings(interface="virtual", channel=CHANNEL)
# Three makers, shuffled ids, motors the other way round, zeros anywhere.
MOUNTINGS = {
    "left_hip": Mounting(11, -1, 12_000),
    "left_knee": Mounting(7, 1, -30_500),
    "left_ankle": Mounting(23),
    "right_hip": Mounting(2, 1, 4_096),
    "right_knee": Mounting(40, -1, 0),
    "right_ankle": Mounting(3, -1, -777),
}
DRIVES = {
    "left_hip": SHIPPED / "trinamic_tmcm_1270.eds",
    "right_hip": SHIPPED / "trinamic_tmcm_1270.eds",
    "right_knee": SHIPPED / "elmo_gold.dcf",
}
POSTURES = {"Stand upright": [0, 0], "Lean forward": [25, 0], "Lean to your left": [0, 25]}
STRAIGHT, BENT = 2.0, 47.0


class Person:
    """Does what is asked with the hands, and types."""

    def __init__(self, robot: SimulatedRobot, until: str | None = None) -> None:
        self.read: list[str] = []
        self._folder = robot.folder.path
        self._until = until

    def say(self, text: str) -> None:
        self.read.append(text)

    def ask(self, question: Ask) -> str:
        self.read.append(question.text)
        assert len(self.read) < 150, self.read[:12]
        if self._until is not None and self._until in question.text:
            raise EOFError
        return self._answer(question)

    def _answer(self, question: Ask) -> str:
        asked = question.text
        joint = next((name for name in JOINTS if name.replace("_", " ") in asked), "")
        if "Are these all" in asked:
            return "all" if asked.startswith("6 ") else "again"
        if "How is the robot called" in asked:
            return "exo-01"
        if asked.startswith("Bend the"):
            self._move(joint, 60.0)
        elif "Hold the" in asked:
            angle = STRAIGHT if "one known angle" in asked else BENT
            self._move(joint, angle)
            return f"{angle:g}"
        elif "as straight as" in asked:
            self._move(joint, -5.0)
        elif "as bent as" in asked:
            self._move(joint, 90.0)
        elif "Counts of its encoder" in asked:
            return "4096"
        elif "rated current" in asked:
            return "5"
        elif "rated torque" in asked:
            return "40"
        elif "its file?" in asked or "heartbeat" in asked or "May the" in asked:
            return "y"
        elif "stamp with" in asked:
            ask(self._folder, {"stamp": "left" if "left" in asked else "right"})
        for posture, lean in POSTURES.items():
            if asked.startswith(posture):
                ask(self._folder, {"lean": lean})
        return ""

    def _move(self, joint: str, degrees: float) -> None:
        ask(self._folder, {"hand": joint, "degrees": degrees})


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[SimulatedRobot]:
    made = SimulatedRobot(
        tmp_path / "sim", Scenario.STAND, virtual_channel=CHANNEL, mountings=MOUNTINGS, drives=DRIVES
    )
    with made as robot:
        ask(robot.folder.path, {"controller": "stop"})
        for joint in JOINTS:  # the emergency stop is pressed: no drive has power
            ask(robot.folder.path, {"fault": "sto", "on": joint})
        yield robot


def go(draft: Draft, person: Person, ports: Sequence[str] = ()) -> None:
    bench = CanBench("main", SETTINGS)
    draft.put("can.main", "interface", "virtual")
    draft.put("can.main", "channel", CHANNEL)
    try:
        run(commission(draft, bench, Library(files([])), SerialPorts(), ports), person)
    finally:
        bench.close()


def test_six_drives_of_three_makers_become_a_file_that_is_true(robot: SimulatedRobot, tmp_path: Path) -> None:
    file = tmp_path / "exo-01.toml"
    with pytest.raises(EOFError):
        go(Draft(file), Person(robot, until="Hold the right hip"))
    draft, second = Draft(file), Person(robot)
    go(draft, second)
    assert not any("left hip" in line for line in second.read), "what was known is not asked again"
    file.write_text(text(draft, "Ada", "2026-11-23T10:00:00Z"), encoding="utf-8")
    found = examine(file)
    assert found.config is not None, found.findings
    assert set(found.config.joint) == set(JOINTS)
    for name, mounting in MOUNTINGS.items():
        joint = found.config.joint[name]
        assert (joint.node_id, joint.direction) == (mounting.node_id, mounting.direction)
        assert joint.counts_per_revolution * joint.gear_ratio == pytest.approx(409_600, rel=1e-3)
        assert joint.zero_offset == pytest.approx(mounting.angle(0, 409_600 / 6.283185307), abs=1e-3)
        assert Path(joint.eds).name == DRIVES.get(name, SHIPPED / "joint_drive.eds").name


@pytest.mark.nightly  # it listens for half a minute
def test_feet_are_told_apart_by_a_stamp_and_the_imu_by_three_postures(
    robot: SimulatedRobot, tmp_path: Path
) -> None:
    draft = Draft(tmp_path / "exo-01.toml")
    draft.put("robot", "joints", [])
    ports = {name: str(robot.folder.path / name) for name in ("right_insole", "left_insole", "trunk")}
    go(draft, Person(robot), list(ports.values()))
    for foot in ("left_insole", "right_insole"):
        assert draft.value(f"insole.{foot}", "port") == ports[foot]
        assert draft.value(f"insole.{foot}", "format") == "insole-cobs"
    assert draft.value("imu.trunk", "axes") == ["x", "y", "z"]
    assert draft.value("imu.trunk", "format") == "witmotion"
