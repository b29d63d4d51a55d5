"""A STOP that is not confirmed: whether the robot moves still, and what is to be done first."""

from typing import Final

from gateway.client import NOTHING_SENT
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.drive_states import (
    device_of,
    drives_did,
    is_live,
    listed,
    moving_joints,
    state_words,
)
from server_gui.core.alarms.marks import ENABLED
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.stop import StopProgress, is_off

STOP_AGAIN: Final = "STOP again"
KEEP_AT_HAND: Final = "keep the hardware stop at hand"
NO_LINK: Final = "no link, nothing was sent"


def unconfirmed(robot: Robot) -> Kind:
    """Return what a robot is in after a STOP that is not confirmed: the same word of it everywhere."""
    return Kind.STILL_MOVING if is_live(robot) and moving_joints(robot) else Kind.NOT_STOPPED


def unconfirmed_alarm(robot: Robot, stopping: StopProgress) -> Alarm:
    """Return the alarm; what is to be done stands before its cause."""
    kind, first = unconfirmed(robot), ", ".join(remedy(robot, stopping))
    cause, _, more = stopping.why.partition("; ")
    aside = ""
    if kind is Kind.STILL_MOVING:
        what, more, aside = STOP_AGAIN, "", f"the STOP before failed: {_then(stopping.why)}"
    elif silent := silent_controllers(robot, stopping):
        what, more = silent, ""
    else:
        cause = NO_LINK if cause.startswith(NOTHING_SENT) else cause
        what = f"{first} · {cause}"
    did = _after_unconfirmed(robot)
    return Alarm(kind, "", what, did=did, check=first, since_s=stopping.since_s, aside=aside, why=more)


def silent_controllers(robot: Robot, stopping: StopProgress) -> str:
    """Return that drives are off, and who may enable them again; empty where it is not only that."""
    words, names = state_words(robot).values(), [name.replace("_", " ") for name in stopping.silent]
    if not names or not is_live(robot) or not words or moving_joints(robot) or not all(map(is_off, words)):
        return ""
    every = "the drive is off" if len(words) == 1 else f"all {len(words)} drives are off"
    if len(names) == 1:
        return f"{every}, the {names[0]} controller did not answer: it may enable them again"
    return f"{every}, the controllers {', '.join(names)} did not answer: they may enable them again"


def _spoken_node(robot: Robot, name: str) -> str:
    """`gait (node 16)`."""
    node_id = device_of(robot, name).get("node_id")
    spoken = name.replace("_", " ")
    return spoken if node_id is None else f"{spoken} (node {node_id})"


def _then(why: str) -> str:
    """Return why a STOP failed, said when that is past: there is a link again."""
    return "there was no link" if why.startswith(NOTHING_SENT) else why


def remedy(robot: Robot, stopping: StopProgress) -> tuple[str, ...]:
    """Return what to do after a STOP that nobody has confirmed, the first thing first."""
    if silent_controllers(robot, stopping):
        return KEEP_AT_HAND, f"check {', '.join(_spoken_node(robot, name) for name in stopping.silent)}"
    is_off = is_live(robot) and None not in state_words(robot).values() and not moving_joints(robot)
    if is_off:
        return ("STOP again to be sure",)
    return (STOP_AGAIN, "or use the hardware stop") if is_live(robot) else ("use the hardware stop",)


def _after_unconfirmed(robot: Robot) -> str:
    """Return what the robot does after a STOP that nobody has confirmed."""
    if not is_live(robot):
        return "what it does now is not known"
    moving = moving_joints(robot)
    words = [*state_words(robot).values()]
    if len(words) > 1 and words.count(ENABLED) == len(words):
        return f"all {len(words)} drives enabled"
    if moving:
        return f"enabled or moving: {listed(moving)}"
    return drives_did(robot)
