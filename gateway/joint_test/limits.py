"""Limits of a joint test (range, speed, torque): the narrowest of file and drive."""

import fnmatch
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from gateway.config.guard_rules import GuardRule, LevelRule, RangeRule
from gateway.joint_test.motion import MOST_SHARE, JointTestKind, Wish, planned

MOST_SPEED = math.radians(180.0)  # rad/s, whatever the drive allows
LAG = math.radians(5.0)  # that a joint may follow behind
LATE_S = 0.1  # that a cycle may come after its time: the heartbeat may stay away for 0.25 s
EXTRA_S, SLOWER = 5.0, 1.25  # a cycle that is late moves the others
OVERSHOOT = 0.5  # of the amplitude, for which there must be room before an end


class NotAllowed(Exception):
    """The joint must not be moved so; why."""


@dataclass(frozen=True, slots=True)
class JointTestLimits:
    """Limits that end a test; angles are the joint's own (rad)."""

    low: float
    high: float
    speed: float  # rad/s
    torque: float  # N·m
    current: float | None  # A; None: it is not watched
    lag: float  # rad
    time_s: float
    late_s: float


@dataclass(frozen=True, slots=True)
class AskedLimits:
    """Limits that somebody has asked for; `None`: what is usual."""

    speed: float | None = None  # rad/s
    torque: float | None = None  # N·m
    late_s: float = LATE_S


@dataclass(frozen=True, slots=True)
class Drive:
    """The drive's own limits; `None` if unknown."""

    low: float | None  # 607Dh, as angles of the joint
    high: float | None
    torque: float | None  # N·m: the least of 6072h and 6073h
    rated_torque: float | None  # N·m
    rated_current: float | None  # A


def limits(
    wish: Wish,
    asked: AskedLimits,
    drive: Drive,
    rules: Mapping[str, GuardRule],
    joint: str,
    angle: float,
    period_s: float,
) -> JointTestLimits:
    """Return the limits of this test, for a joint that stands at `angle`.

    Raises:
        NotAllowed: something that must be known is not, or the test would go beyond it.

    """
    if not drive.rated_torque:
        raise NotAllowed("its rated torque is not known: set rated_torque, or 6076h in the drive")
    if not drive.torque:
        raise NotAllowed("its drive tells no limit of current or torque (6073h, 6072h)")
    low, high = _range(drive, rules, joint)
    first, last, fastest, time_s = planned(wish, period_s)
    if wish.kind is JointTestKind.CHIRP and wish.high_hz > MOST_SHARE / period_s:
        raise NotAllowed(
            f"{wish.high_hz:g} Hz is beyond a quarter of its {1 / period_s:g} cycles a second: ask for less"
        )
    check_room(wish, angle, (first, last), (low, high))
    speed = _least("speed", "rad/s", asked.speed, MOST_SPEED, _levels(rules, joint, "velocity"))
    if fastest > speed:
        raise NotAllowed(
            f"its target would move at {math.degrees(fastest):.3g}°/s, beyond {math.degrees(speed):.3g}°/s"
        )
    most = min((drive.torque, *_levels(rules, joint, "torque")))
    torque = (
        min(drive.rated_torque, most)
        if asked.torque is None
        else _least("torque", "N·m", asked.torque, most, ())
    )
    if wish.kind is JointTestKind.RELAY and wish.torque > torque / 2:
        raise NotAllowed(
            f"a relay of {wish.torque:g} N·m needs room for the load's torque: its limit, {torque:.3g} N·m, "
            "must be twice that"
        )
    share = max(1.0, torque / drive.rated_torque)  # who asks for more torque asks for its current too
    currents = [
        *_levels(rules, joint, "current"),
        *([share * drive.rated_current] if drive.rated_current else []),
    ]
    lags = _levels(rules, joint, "following_error")
    return JointTestLimits(
        low=low,
        high=high,
        speed=speed,
        torque=torque,
        current=min(currents, default=None),
        lag=min((LAG, *lags)),
        time_s=EXTRA_S + SLOWER * time_s,
        late_s=asked.late_s,
    )


def check_room(wish: Wish, angle: float, targets: tuple[float, float], ends: tuple[float, float]) -> None:
    """Check that the extremes of `targets`, relative to `angle`, are well within its `ends` (rad).

    Raises:
        NotAllowed: it would come too near to one, or beyond.

    """
    room = OVERSHOOT * wish.amplitude
    (first, last), (low, high) = targets, ends
    if not low <= angle + first - room or not angle + last + room <= high:
        raise NotAllowed(
            f"from {math.degrees(angle):.1f}° it would go to {math.degrees(angle + first):.1f}° … "
            f"{math.degrees(angle + last):.1f}°, and may overshoot by {math.degrees(room):.1f}°: that is not "
            f"within its limits {math.degrees(low):.1f}° … {math.degrees(high):.1f}°. Bring it elsewhere by "
            "hand, or ask for less"
        )


def _least(what: str, unit: str, asked: float | None, most: float, levels: tuple[float, ...]) -> float:
    allowed = min((most, *levels))
    if asked is not None and asked > allowed:
        raise NotAllowed(
            f"a limit of {asked:.3g} {unit} was asked for; its {what} may be {allowed:.3g} at most"
        )
    return allowed if asked is None else asked


def _range(drive: Drive, rules: Mapping[str, GuardRule], joint: str) -> tuple[float, float]:
    found = [rule for rule in of_joint(rules, joint, "joint_limit") if isinstance(rule, RangeRule)]
    lows = [one for one in (drive.low, *(rule.min for rule in found)) if one is not None]
    highs = [one for one in (drive.high, *(rule.max for rule in found)) if one is not None]
    if not lows or not highs:
        raise NotAllowed(
            f"nobody knows how far it goes: give it a joint_limit rule, [guard.rule.{joint}_range], or the "
            "drive its 607Dh"
        )
    return max(lows), min(highs)


def _levels(rules: Mapping[str, GuardRule], joint: str, watch: str) -> tuple[float, ...]:
    return tuple(rule.above for rule in of_joint(rules, joint, watch) if isinstance(rule, LevelRule))


def of_joint(rules: Mapping[str, GuardRule], joint: str, watch: str) -> Iterator[GuardRule]:
    """Yield the guard's rules of this kind that watch the joint."""
    for rule in rules.values():
        globs = rule.on or ("*",)
        if rule.watch == watch and any(fnmatch.fnmatchcase(joint, glob) for glob in globs):
            yield rule
