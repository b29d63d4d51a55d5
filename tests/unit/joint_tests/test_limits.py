"""Before anything has power: what file or drive do not allow, or nobody knows, is refused."""

import math
from dataclasses import replace
from typing import Any

import pytest

from gateway.config.guard_rules import GuardRule, LevelRule, RangeRule
from gateway.joint_test.limits import MOST_SPEED, AskedLimits, Drive, JointTestLimits, NotAllowed, limits
from gateway.joint_test.motion import JointTestKind, Motion, Wish, motion, planned

DEGREE = math.radians(1.0)
DRIVE = Drive(low=-1.0, high=2.0, torque=80.0, rated_torque=40.0, rated_current=5.0)
USUAL = AskedLimits()
STEP = Wish(JointTestKind.STEP, 1.0 * DEGREE, 10.0 * DEGREE)
CHIRP = Wish(JointTestKind.CHIRP, DEGREE, 15 * DEGREE, low_hz=0.2, high_hz=15.0, seconds=10.0)
RELAY = Wish(JointTestKind.RELAY, 5 * DEGREE, 0.0, torque=10.0)
FRICTION = Wish(JointTestKind.FRICTION, 10 * DEGREE, 20 * DEGREE)
EVERY = (STEP, CHIRP, FRICTION)


def allowed(
    wish: Wish = STEP,
    drive: Drive = DRIVE,
    asked: AskedLimits = USUAL,
    angle: float = 0.5,
    **rules: GuardRule,
) -> JointTestLimits:
    return limits(wish, asked, drive, rules, "left_knee", angle, 0.01)


def test_the_narrowest_of_file_and_drive_counts() -> None:
    found = allowed(
        ends=RangeRule(watch="joint_limit", on=("left_*",), min=-0.5),
        other=RangeRule(watch="joint_limit", on=("right_knee",), min=0.4),
        fast=LevelRule(watch="velocity", above=1.0),
        strong=LevelRule(watch="torque", above=30.0),
        behind=LevelRule(watch="following_error", above=0.02),
    )
    assert (found.low, found.high) == (-0.5, 2.0)
    assert (found.speed, found.torque, found.current, found.lag) == (1.0, 30.0, 5.0, 0.02)


def test_who_asks_for_more_torque_gets_the_current_for_it() -> None:
    assert [allowed(asked=AskedLimits(torque=most)).current for most in (20.0, 40.0, 80.0)] == [
        5.0,
        5.0,
        10.0,
    ]
    current = LevelRule(watch="current", above=6.0)
    assert allowed(asked=AskedLimits(torque=80.0), current=current).current == 6.0


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"drive": replace(DRIVE, low=None)}, "nobody knows how far it goes"),
        ({"drive": replace(DRIVE, rated_torque=None)}, "rated torque is not known"),
        ({"drive": replace(DRIVE, torque=None)}, "no limit of current or torque"),
        ({"angle": 1.99}, "not within its limits"),
        ({"angle": 2.0 - 1.2 * DEGREE}, "may overshoot"),
        ({"angle": -3.0}, "not within its limits"),
        ({"wish": replace(STEP, amplitude=5 * DEGREE, speed=400 * DEGREE)}, "its target would move at"),
        ({"wish": replace(CHIRP, high_hz=40.0)}, "beyond a quarter"),
        ({"wish": RELAY, "asked": AskedLimits(torque=15.0)}, "must be twice that"),
        ({"asked": AskedLimits(torque=100.0)}, "may be 80 at most"),
        ({"asked": AskedLimits(speed=2 * MOST_SPEED)}, "at most"),
    ],
)
def test_what_is_not_allowed_or_not_known_is_refused(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(NotAllowed, match=words):
        allowed(**wrong)


@pytest.mark.parametrize("wish", EVERY)
def test_a_motion_goes_no_further_and_no_faster_than_is_told(wish: Wish) -> None:
    low, high, fastest, time_s = planned(wish, 0.01)
    assert max(-low, high) <= wish.amplitude * 1.0001
    assert fastest <= wish.speed * 1.01
    targets = list(motion(wish, 0.01))
    assert targets[0] == targets[-1] == 0.0
    assert len(targets) * 0.01 == pytest.approx(time_s)


def stand_still(targets: Motion) -> None:
    for _ in range(200):
        targets.send(-0.01)


def test_a_relay_pushes_back_and_ends_where_nothing_swings() -> None:
    targets = motion(replace(RELAY, repeat=3), 0.01)
    assert next(targets) == 10.0
    assert targets.send(0.01) == -10.0
    assert targets.send(-0.01) == 10.0
    held = [targets.send(-0.01) for _ in range(200)]
    assert set(held) == {10.0}
    with pytest.raises(StopIteration):
        stand_still(targets)
