"""A joint that cannot be believed is named; whatever a wearer does with a good one is no alarm.

The robot is the simulator's, in simulated time; what is judged is what its drives' objects say.
"""

from pathlib import Path

import pytest

from drivers.joint import mirror_check
from drivers.joint.plausibility import JUMP_SHOWN_S, LOADED_S, JointCheck, Motion
from hil_sim.exoskeleton import Scenario
from tests.unit.joint.watched import WatchedRobot

STEP_NS = 50_000_000
GAIT_S = 4.0  # of the fewest strides that the two legs can be compared by


@pytest.fixture
def compared_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer strides are compared than usual, and so more often."""
    monkeypatch.setattr(mirror_check, "GAIT_S", GAIT_S)


@pytest.mark.usefixtures("compared_soon")
@pytest.mark.parametrize("scenario", Scenario)
def test_whatever_a_wearer_does_raises_no_alarm(tmp_path: Path, scenario: Scenario) -> None:
    seconds = 30.0 if scenario is Scenario.DAY else 3 * GAIT_S
    assert WatchedRobot(tmp_path, scenario, seed=1).run(seconds) == {}


@pytest.mark.parametrize("fault", ["gear_slip", "sto", "overcurrent", "drift", "runaway"])
def test_other_faults_of_a_drive_are_none_of_its_encoder(tmp_path: Path, fault: str) -> None:
    robot = WatchedRobot(tmp_path, Scenario.WALK, whole=True)
    robot.run(1)
    robot.faults.begin(fault, "left_knee")
    assert robot.run(3) == {}


def test_encoders_that_are_stuck_are_named_until_they_move_again(tmp_path: Path) -> None:
    """One of each joint, and those of the other leg are none."""
    stuck = {"left_hip", "left_knee", "left_ankle"}
    robot = WatchedRobot(tmp_path, Scenario.WALK)
    robot.run(3)
    assert robot.said == {}
    for name in stuck:
        robot.faults.begin("encoder_stuck", name)
    robot.run(2)
    for name in stuck:
        said = robot.words(name)
        assert "stays the same to the count while its target moves by" in said
        assert "(for 2 s): check its encoder" in said
    assert set(robot.said) == stuck
    robot.faults.clear()
    robot.run(1)
    assert not any("stays the same" in robot.words(name) for name in stuck)


def test_encoders_that_jump_are_named(tmp_path: Path) -> None:
    """Whenever between two looks they do: the drive pulls the joint back at once."""
    robot = WatchedRobot(tmp_path, Scenario.STAND)
    robot.run(4.30)
    jumps = {"left_knee": -5, "left_hip": 5, "left_ankle": 5, "right_hip": 20, "right_knee": 5}
    for (name, degrees), wait_s in zip(jumps.items(), (0.01, 0.02, 0.01, 0.005, 1.0), strict=True):
        robot.faults.begin("encoder_jump", name, params={"degrees": degrees})
        robot.run(wait_s)
    for name in jumps:
        assert "its position jumped by" in robot.words(name)
        assert "check its encoder and the encoder's cable, and home it again" in robot.words(name)
    assert set(robot.said) == set(jumps)


def test_a_joint_that_is_all_but_jammed_is_to_be_looked_at(tmp_path: Path) -> None:
    robot = WatchedRobot(tmp_path, Scenario.WALK)
    robot.run(2)
    robot.faults.begin("following_error", "left_knee")
    robot.run(4)
    assert "check its encoder and the encoder's cable, and that the joint can move" in robot.words(
        "left_knee"
    )


@pytest.mark.usefixtures("compared_soon")
@pytest.mark.parametrize("name", ["left_knee", "right_knee"])
def test_a_knee_that_counts_the_other_way_is_told_of_both(tmp_path: Path, name: str) -> None:
    robot = WatchedRobot(tmp_path, Scenario.WALK, mirrored=name)
    robot.run(2 * GAIT_S)
    assert robot.said == {}
    robot.run(2 * GAIT_S)
    assert set(robot.said) == {"left_knee", "right_knee"}
    assert "it bends where left_knee stretches" in robot.words("right_knee")
    assert "check direction and zero_offset in [joint.left_knee]" in robot.words("left_knee")


class Still:
    """A joint that stands at one place, as a test tells it."""

    def __init__(self) -> None:
        self.check = JointCheck("left_knee")
        self.check.loaded.rated = 40.0
        self._now_ns = 0

    def unseen(self, seconds: float) -> None:
        self._now_ns += round(seconds * 1e9)

    def hold(self, seconds: float, **values: float | None) -> str:
        known = {"velocity": 0.0, "torque": 0.0, "following_error": 0.0, "position": 0.5, **values}
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self._now_ns += STEP_NS
            position = known["position"] or 0.0
            mode, enabled = round(known.get("mode") or 8), bool(known.get("enabled", 1))
            now = Motion(
                self._now_ns,
                position,
                known["velocity"],
                known["torque"],
                known["following_error"],
                mode,
                enabled,
            )
            self.check.update(now, lambda: None)
        return "; ".join(finding.words for finding in self.check.findings)


def test_a_jump_is_shown_for_a_while() -> None:
    joint = Still()
    joint.hold(1.0)
    assert "its position jumped by" in joint.hold(1.0, position=0.6)
    assert "its position jumped by" in joint.hold(JUMP_SHOWN_S - 2.0, position=0.6)
    assert joint.hold(2.0, position=0.6) == ""


def test_torque_without_motion_is_no_claim_about_the_encoder() -> None:
    joint = Still()
    assert joint.hold(LOADED_S, torque=30.0, following_error=0.1) == ""
    assert joint.hold(0.2, torque=30.0, following_error=0.1) == "torque without motion (30 N·m)"
    (finding,) = joint.check.findings
    assert finding.check == "check that the joint can move and its encoder"
    assert joint.hold(0.1, torque=30.0, following_error=0.1, position=0.52) == ""


@pytest.mark.parametrize(
    "values",
    [
        {"torque": 39.0},  # holds a wearer where it should
        {"torque": 19.0, "following_error": 0.5},
        {"torque": 30.0, "following_error": None},
        {"torque": 60.0, "following_error": 0.5, "enabled": 0.0},
        {"torque": None, "following_error": 0.5},
        {"torque": 30.0, "following_error": 0.5, "mode": 10.0},  # in torque mode no position is followed
    ],
)
def test_a_joint_that_holds_its_load_is_not_blocked(values: dict[str, float | None]) -> None:
    assert Still().hold(30.0, **values) == ""


def test_a_velocity_beside_a_position_that_stands_is_a_frozen_encoder() -> None:
    joint = Still()
    assert joint.hold(60.0, velocity=0.02) == "", "noise of a joint that stands"
    assert "the same to the count while it turns at 0." in joint.hold(2.0, velocity=0.5)


def test_what_nobody_saw_lasted_is_not_held_against_a_joint() -> None:
    joint = Still()
    joint.hold(0.1, torque=30.0, following_error=0.5, velocity=0.5)
    joint.unseen(LOADED_S)
    assert joint.hold(0.1, torque=30.0, following_error=0.5, velocity=0.5) == ""
    joint.unseen(2.0)
    assert "torque without motion" in joint.hold(LOADED_S + 0.1, torque=30.0, following_error=0.5)
    joint.unseen(2.0)
    assert "torque without motion" in joint.hold(0.1, torque=30.0, following_error=0.5), "what is known stays"


def test_homing_may_set_the_position() -> None:
    joint = Still()
    joint.hold(1.0, mode=6.0)
    assert joint.hold(1.0, position=1.5, mode=6.0) == ""


def test_what_was_seen_before_the_drive_began_anew_says_nothing() -> None:
    joint = Still()
    assert joint.hold(4.0, velocity=0.5) != ""
    joint.check.restart()
    assert joint.hold(4.0, position=2.0) == ""
