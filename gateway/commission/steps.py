"""Commissioning from an interface's name to a robot's file, in the order in which it is gone through.

What the draft has is not asked again: a dialogue that was interrupted goes on where it was.
"""

from collections.abc import Sequence

from drivers.scan.identification import NodeAnswers
from drivers.scan.products import Library
from gateway.commission import joints, nodes
from gateway.commission.axes import Axis, axes_of
from gateway.commission.bench import Bench
from gateway.commission.controller import controller
from gateway.commission.dialogue import At, Say, Talk, word
from gateway.commission.draft import Draft
from gateway.commission.homing import homing
from gateway.commission.progress import END, ROBOT
from gateway.commission.sensors import SerialBench, sensors
from gateway.config.robot import NAME

BEGIN = (
    "The joints are moved by hand, without power. What is written to a drive is asked for first. Only homing "
    "enables a drive, where you want it and type its phrase. An interrupted dialogue goes on where it was."
)


def commission(
    draft: Draft, bench: Bench, library: Library, serial: SerialBench, ports: Sequence[str]
) -> Talk[None]:
    """Find out everything that the file of this robot needs; what is found is in the draft."""
    yield Say(BEGIN)
    yield At(ROBOT, "name")
    if not draft.has("robot", "name"):
        name = yield from word("What is the robot called (for example exo-01)?", check=_name_problem)
        draft.put("robot", "name", name)
    yield At(ROBOT, "bus")
    found, told = yield from nodes.scanned(bench)
    yield At(ROBOT, "role")
    yield from nodes.role(draft, found)
    left = list(axes := axes_of(told))
    yield from nodes.same_devices(draft, {axis.node: told[axis.node] for axis in axes})
    yield At(ROBOT, "controller")
    yield from controller(draft, library, told)
    yield At(ROBOT, "joints")
    for joint in (yield from joints.names(draft, axes)):
        yield At(joint, "drive")
        axis = yield from joints.which_drive(draft, bench, joint, left)
        if axis is None:
            continue
        if axis not in left:
            yield Say(f"{axis}, the {joints.words(joint)}, does not answer now: it stays as it was found.")
            continue
        left.remove(axis)
        yield from _joint(draft, bench, library, joint, axis, told[axis.node])
    yield At(END, "sensors")
    yield from sensors(draft, serial, ports)
    yield At(END, "file")


def _joint(
    draft: Draft, bench: Bench, library: Library, joint: str, axis: Axis, told: NodeAnswers
) -> Talk[None]:
    yield At(joint, "file")
    yield from nodes.file_of(draft, library, axis.node, told)
    yield At(joint, "heartbeat")
    yield from nodes.heartbeat(draft, bench, axis.node)
    yield At(joint, "pdo")
    yield from nodes.mapping(draft, bench, axis, told, joint)
    yield At(joint, "scale")
    scale = yield from joints.meaning(draft, bench, joint, axis)
    yield At(joint, "limits")
    yield from joints.limits(draft, bench, joint, axis, scale)
    yield At(joint, "ratings")
    yield from joints.ratings(draft, bench, joint, axis, scale.gear_ratio)
    yield At(joint, "homing")
    yield from homing(draft, bench, joint, axis, scale)


def _name_problem(text: str) -> str | None:
    return None if NAME.fullmatch(text) else f"{text!r} is no name: letters, digits, - and _, a letter first"
