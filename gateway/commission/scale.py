"""From two positions with known angles to what counts mean: direction, gear ratio and zero of a joint."""

import math
from dataclasses import dataclass, replace

AGREES = 0.05  # a share by which hand and eye may be off
LEAST_RAD = math.radians(10.0)  # between the two positions
LEAST_COUNTS = 20
WHOLE = 0.02  # a ratio that is so near to a whole number is that number


@dataclass(frozen=True, slots=True)
class HeldPose:
    """A joint held still: the angle that was told (rad) and what its encoder counts."""

    angle: float
    counts: int


@dataclass(frozen=True, slots=True)
class Nominal:
    """The drive's own values of encoder (608Fh) and gear (6091h); `None` if unknown."""

    counts_per_revolution: float | None
    gear_ratio: float | None


@dataclass(frozen=True, slots=True)
class Scale:
    """Conversion of counts to the joint's angle; see `JointSettings`."""

    counts_per_revolution: float
    gear_ratio: float
    direction: int
    zero_offset: float


def problem(first: HeldPose, second: HeldPose) -> str | None:
    """Return why these two say nothing."""
    if abs(second.angle - first.angle) < LEAST_RAD:
        return f"the two angles must differ by {math.degrees(LEAST_RAD):g}° or more"
    if abs(second.counts - first.counts) < LEAST_COUNTS:
        return (
            f"its encoder counted {second.counts - first.counts} in between: another joint was moved, or the "
            "encoder is dead"
        )
    return None


def counts_per_turn(first: HeldPose, second: HeldPose) -> float:
    """Return the joint's measured counts per turn; negative if counts fall while the angle rises."""
    return (second.counts - first.counts) / (second.angle - first.angle) * math.tau


def disagreement(measured: float, nominal: Nominal) -> float | None:
    """Return the ratio of measured to nominal counts; `None` if both agree, or none are known."""
    if nominal.counts_per_revolution is None or nominal.gear_ratio is None:
        return None
    ratio = abs(measured) / (nominal.counts_per_revolution * nominal.gear_ratio)
    return None if abs(ratio - 1) <= AGREES else ratio


def scale(first: HeldPose, second: HeldPose, counts_per_revolution: float, gear_ratio: float) -> Scale:
    """Return the scale with these; its direction and zero are those of the two positions."""
    direction = 1 if counts_per_turn(first, second) > 0 else -1
    per_count = direction * math.tau / (counts_per_revolution * gear_ratio)
    zeros = [held.angle - held.counts * per_count for held in (first, second)]
    return Scale(counts_per_revolution, gear_ratio, direction, sum(zeros) / 2)


def gear(measured: float, counts_per_revolution: float) -> float:
    """Return the gear ratio that makes them agree; whole where it nearly is."""
    ratio = abs(measured) / counts_per_revolution
    whole = round(ratio)
    return float(whole) if whole and abs(ratio / whole - 1) <= WHOLE else round(ratio, 3)


def near(scale: Scale) -> bool:
    """Return whether the drive's zero is within a turn of the joint's, as the robot's file wants it."""
    return abs(scale.zero_offset) <= math.tau


def counts_at_zero(scale: Scale) -> int:
    """Return the encoder's count at the joint's angle 0."""
    per_count = scale.direction * math.tau / (scale.counts_per_revolution * scale.gear_ratio)
    return round(-scale.zero_offset / per_count)


def with_zero(scale: Scale, angle_there: float, counts: int) -> Scale:
    """Return the scale by which these counts are this angle (rad)."""
    return replace(scale, zero_offset=angle_there - angle(replace(scale, zero_offset=0.0), counts))


def angle(scale: Scale, counts: int) -> float:
    """Return the joint's angle (rad) at a count of its encoder."""
    turns = counts / (scale.counts_per_revolution * scale.gear_ratio)
    return scale.direction * turns * math.tau + scale.zero_offset
