"""The angles between which a joint's drive keeps it: its software position limits (607Dh)."""

from collections.abc import Mapping
from typing import Final

from msgspec import UNSET

from gateway.wire.component import AngleInfo
from gateway.wire.parameter import ParameterValue
from server_gui.core.follow.robot import Robot

LIMITS: Final = 0x607D
AXIS: Final = 0x800  # between the objects of two axes (CiA 402-2 §5)
AXES: Final = frozenset(LIMITS + axis * AXIS for axis in range(8))


def position_ends(robot: Robot, joint: str, held: Mapping[str, ParameterValue]) -> tuple[float, float] | None:
    """Return both as angles of the joint (rad), by the values that its parameters hold.

    None where one of them, or what its counts are as an angle, is not known; and where the lower is not the
    less, with which drives say that there is none.
    """
    angle, described = _angle(robot, joint), robot.description
    if angle is None or described is None:
        return None
    counts: dict[int, float] = {}
    for info in described.parameters:
        at, value = _place(info.object), held.get(info.name)
        if info.component != joint or at is None or value is None or value.value is None or not info.scale:
            continue
        counts[at] = value.value / info.scale
    if counts.keys() != {1, 2} or counts[1] >= counts[2]:
        return None
    ends = [angle.rad_per_count * counts[at] + angle.zero_offset for at in (1, 2)]
    return min(ends), max(ends)


def _angle(robot: Robot, joint: str) -> AngleInfo | None:
    known = () if robot.description is None else robot.description.components
    angle = next((part.angle for part in known if part.name == joint), UNSET)
    return None if angle is UNSET or not angle.rad_per_count else angle


def _place(address: str) -> int | None:
    """Return the sub-index of a limit's object; None of any other object."""
    index, _, subindex = address.partition(":")
    try:
        return int(subindex) if int(index, 16) in AXES and subindex in ("1", "2") else None
    except ValueError:
        return None
