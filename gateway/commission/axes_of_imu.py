"""The axes of an IMU (forward, left and up), from three postures of the trunk (REP-103)."""

import math
from collections.abc import Sequence

from drivers.imu.rotation import Vector

NAMES = ("x", "y", "z", "-x", "-y", "-z")
LEAST = math.sin(math.radians(10.0))  # how far the trunk is to lean
NEAR = math.cos(math.radians(35.0))  # an axis is along a direction within this angle


class NoAxes(ValueError):
    """The three postures do not fit; the message says which, and what to do."""


def axes(upright: Vector, forward: Vector, left: Vector) -> tuple[str, str, str]:
    """Return the sensor's axes along the trunk's forward, left and up.

    `upright`, `forward` and `left` are directions of up in the sensor's axes: of a trunk that stands, leans
    forward and leans to its left. Up moves away from where the trunk leans to.

    Raises:
        NoAxes: it leaned too little, not straight, or the sensor is mounted askew.

    """
    found = (
        _nearest(_away(upright, forward, "forward"), "forward"),
        _nearest(_away(upright, left, "left"), "left"),
        _nearest(upright, "up"),
    )
    if _cross(_vector(found[0]), _vector(found[1])) != _vector(found[2]):
        raise NoAxes(
            f"forward {found[0]}, left {found[1]} and up {found[2]} are no right-handed axes: was the second "
            "posture forward, and the third to the wearer's own left?"
        )
    return found


def _away(upright: Vector, leaning: Vector, where: str) -> Vector:
    moved = [was - now for was, now in zip(upright, leaning, strict=True)]
    length = math.hypot(*moved)
    if length < LEAST:
        raise NoAxes(f"the trunk leaned {where} by less than 10°: lean further")
    return moved[0] / length, moved[1] / length, moved[2] / length


def _nearest(direction: Sequence[float], where: str) -> str:
    best = max(NAMES, key=lambda name: _along(direction, name))
    if _along(direction, best) < NEAR:
        raise NoAxes(f"no axis of the sensor points {where} within 35°: mount it straight, or lean straight")
    return best


def _along(direction: Sequence[float], name: str) -> float:
    return sum(one * other for one, other in zip(direction, _vector(name), strict=True))


def _vector(name: str) -> tuple[int, int, int]:
    sign = -1 if name[0] == "-" else 1
    x, y, z = (sign * (axis == name[-1]) for axis in "xyz")
    return x, y, z


def _cross(one: tuple[int, int, int], other: tuple[int, int, int]) -> tuple[int, int, int]:
    return (
        one[1] * other[2] - one[2] * other[1],
        one[2] * other[0] - one[0] * other[2],
        one[0] * other[1] - one[1] * other[0],
    )
