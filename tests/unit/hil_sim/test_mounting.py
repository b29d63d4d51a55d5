"""Drives that are built in otherwise, and somebody's hands at a joint."""

import math

import pytest

from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import CONTROLLER_NODE, JOINTS, Exoskeleton
from hil_sim.mounting import Mounting, choose

USUAL = {"left_knee": 2, "right_knee": 5}


def test_a_word_says_node_direction_and_zero_and_the_others_stay() -> None:
    assert choose(["left_knee=9,-1,1200"], USUAL) == {
        "left_knee": Mounting(9, -1, 1200),
        "right_knee": Mounting(5),
    }


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("knee=9", "there is no joint 'knee'"),
        ("left_knee", "is not JOINT=NODE"),
        ("left_knee=9,-1,0,4", "is not JOINT=NODE"),
        ("left_knee=9,2", "the direction 1 or -1"),
        ("left_knee=128", "the node id is 1 to 127"),
        ("left_knee=5", "two nodes would have the id 5"),
        ("left_knee=16", "two nodes would have the id 16"),
    ],
)
def test_what_cannot_be_built_in_is_refused(word: str, said: str) -> None:
    with pytest.raises(SimulatorError, match=said):
        choose([word], USUAL, [CONTROLLER_NODE])


@pytest.mark.parametrize("mounting", [Mounting(2), Mounting(40, -1, 777)])
def test_hands_move_a_joint_without_power_and_its_drive_counts(mounting: Mounting) -> None:
    robot = Exoskeleton(mountings={"left_knee": mounting})
    drive = robot.drives["left_knee"]
    robot.hands.move(drive, mounting, math.radians(30))
    counts = drive.dictionary[0x6064, 0].number()
    assert mounting.angle(counts, drive.counts_per_radian) == pytest.approx(math.radians(30), abs=1e-4)
    robot.hands.move(drive, mounting, math.radians(170))
    counts = drive.dictionary[0x6064, 0].number()
    assert mounting.angle(counts, drive.counts_per_radian) == pytest.approx(math.radians(130), abs=1e-4)


def test_nobody_takes_hold_of_a_joint_under_power() -> None:
    robot = Exoskeleton()
    robot.power_on()
    robot.clock.run_until(2_000_000_000)
    with pytest.raises(SimulatorError, match="left_knee is under power"):
        robot.hands.move(robot.drives["left_knee"], robot.mountings["left_knee"], 0.5)


def test_a_robot_that_is_built_in_otherwise_walks_as_ever() -> None:
    mountings = {"left_knee": Mounting(40, -1, 777), "right_hip": Mounting(7, 1, -3000)}
    usual, other = Exoskeleton(), Exoskeleton(mountings=mountings)
    for robot in (usual, other):
        robot.power_on()
        robot.clock.run_until(2_500_000_000)
    for name in JOINTS:
        angles = [robot.mountings[name].seen(robot.drives[name].joint.position) for robot in (usual, other)]
        assert angles[0] == pytest.approx(angles[1], abs=math.radians(0.5)), name
