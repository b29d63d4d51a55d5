"""A robot of unknown drives is commissioned by somebody who only reads, moves joints by hand and types."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from drivers.bus.settings import CanSettings
from drivers.scan.products import Library, files
from eds.shipped import SHIPPED
from gateway.commission.axes import Axis, powered
from gateway.commission.bench import CanBench
from gateway.commission.dialogue import run
from gateway.commission.draft import Draft
from gateway.commission.serial_bench import SerialPorts
from gateway.commission.steps import commission
from gateway.commission.stopping import stop
from gateway.commission.writing import text
from gateway.config.reading import examine
from hil_sim.exoskeleton import JOINTS, Scenario
from hil_sim.robot import SimulatedRobot
from tests.support.waiting import until
from tests.unit.commission.person import DRIVES, MOUNTINGS, Person, emergency_stop

CHANNEL = "commission"
SETTINGS = CanSettings(interface="virtual", channel=CHANNEL)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[SimulatedRobot]:
    made = SimulatedRobot(
        tmp_path / "sim", Scenario.STAND, virtual_channel=CHANNEL, mountings=MOUNTINGS, drives=DRIVES
    )
    with made as robot, emergency_stop(robot.folder.path):
        yield robot


def go(draft: Draft, person: Person, ports: Sequence[str] = ()) -> None:
    bench = CanBench("main", SETTINGS)
    draft.put("can.main", "interface", "virtual")
    draft.put("can.main", "channel", CHANNEL)
    try:
        run(commission(draft, bench, Library(files([])), SerialPorts(), ports), person)
    finally:
        bench.close()


@pytest.mark.parametrize(
    "joints",
    [
        pytest.param(["left_hip", "left_knee", "right_knee"], id="three"),
        pytest.param(list(JOINTS), id="all", marks=pytest.mark.nightly),
    ],
)
def test_drives_of_three_makers_become_a_file_that_is_true(
    robot: SimulatedRobot, tmp_path: Path, joints: list[str]
) -> None:
    file = tmp_path / "exo-01.toml"
    draft = Draft(file)
    draft.put("robot", "joints", joints)
    go(draft, Person(robot.folder.path))
    file.write_text(text(draft, "Ada", "2026-11-23T10:00:00Z"), encoding="utf-8")
    found = examine(file)
    assert found.config is not None, found.findings
    assert set(found.config.joint) == set(joints)
    for name in joints:
        mounting = MOUNTINGS[name]
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
    go(draft, Person(robot.folder.path), list(ports.values()))
    for foot in ("left_insole", "right_insole"):
        assert draft.value(f"insole.{foot}", "port") == ports[foot]
        assert draft.value(f"insole.{foot}", "format") == "insole-cobs"
    assert draft.value("imu.trunk", "axes") == ["x", "y", "z"]
    assert draft.value("imu.trunk", "format") == "witmotion"


def test_a_stop_reaches_every_drive_that_was_found_and_tells_of_one_that_is_silent(tmp_path: Path) -> None:
    draft = Draft(tmp_path / "exo-01.toml")
    for node in (1, 2, 77):
        draft.put(f"node.{node}", "identity", [0, 0, node])
    bench = CanBench("main", CanSettings(interface="virtual", channel="stopped"))
    with SimulatedRobot(tmp_path / "sim", Scenario.STAND, virtual_channel="stopped"):
        try:
            until(lambda: powered(bench, [Axis(1), Axis(2)]) == (Axis(1), Axis(2)), "both have power")
            found = stop(bench, draft)
            confirmed = {f"node {node}": "confirmed" for node in range(1, 7)}  # those not found yet, too
            assert found.drives == {**confirmed, "node 77": "unreachable"}
            assert (found.confirmed, found.words) == (False, "NOT CONFIRMED: node 77 is unreachable")
            draft.forget("node.77")
            bench.close()  # as a homing does, which opens it as its master
            assert bench._bus.problem is None, "that it was closed is no problem when it is opened again"
            assert stop(bench, draft).confirmed
            draft.tables.clear()
            assert "no drive is known yet" in stop(bench, draft).words
        finally:
            bench.close()
