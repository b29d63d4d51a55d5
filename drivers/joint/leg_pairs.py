"""Pairs of the same joint of both legs, each judged against the other."""

from collections.abc import Mapping
from typing import cast

from drivers.component import Component, ComponentKind
from drivers.joint.drive import JointDrive


def join_joints(components: Mapping[str, Component]) -> None:
    """Let `left_NAME` and `right_NAME` know each other."""
    for name, left in components.items():
        side, _, joint = name.partition("_")
        right = components.get(f"right_{joint}")
        if (
            side == "left"
            and left.kind is ComponentKind.JOINT
            and right is not None
            and right.kind is ComponentKind.JOINT
        ):
            one, other = cast("JointDrive", left), cast("JointDrive", right)
            one.compare_with(other)
            other.compare_with(one)
