"""A robot that has not stopped, or is enabled again: which of it, and what is to be done first."""

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
    unknown_joints,
)
from server_gui.core.alarms.marks import ASKED, ENABLED, STATES, STILL_ENABLED, Mark
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.stop import StopProgress, StopState, is_off

STOP_AGAIN: Final = "STOP again"
KEEP_AT_HAND: Final = "keep the hardware stop at hand"
USE_HARDWARE: Final = "use the hardware stop"
NO_LINK: Final = "no link, nothing was sent"
LET_GO: Final = "the robot says that it holds none, somebody may have reset it"


def unconfirmed(robot: Robot) -> Kind:
    """Return what a robot is in after a STOP that is not confirmed: the same word of it everywhere."""
    return Kind.STILL_MOVING if is_live(robot) and moving_joints(robot) else Kind.NOT_STOPPED


def enabled_again(robot: Robot, stopping: StopProgress) -> list[str]:
    """Return joints whose drive is enabled while a stop is held, by a row that is newer than what says so.

    None while a STOP is on its way or not confirmed, which is told of it then.
    """
    is_open = stopping.state in (StopState.SENT, StopState.NOT_CONFIRMED)
    if is_open or not stopping.held or not is_live(robot) or not robot.is_newer_than(stopping.held_ns):
        return []
    return [joint for joint, word in state_words(robot).items() if word == ENABLED]


def enabled_mark(robot: Robot, stopping: StopProgress) -> Mark:
    """Return the mark of a drive that is enabled: no good state while a stop is sent or held."""
    if stopping.is_unproven or stopping.is_let_go or enabled_again(robot, stopping):
        return STILL_ENABLED
    return ASKED if stopping.held or stopping.state is StopState.SENT else STATES[ENABLED]


def unstopped(robot: Robot, stopping: StopProgress) -> Kind | None:
    """Return what a robot is in that was to stop and has not, or has not stayed so: the same everywhere."""
    if stopping.is_unproven:
        return unconfirmed(robot)
    if stopping.is_let_go:
        return Kind.NOT_HELD
    return Kind.ENABLED_AGAIN if enabled_again(robot, stopping) else None


def again_alarm(robot: Robot, stopping: StopProgress) -> Alarm:
    """Return the alarm of drives that are enabled while a stop is held."""
    again = enabled_again(robot, stopping)
    what = f"all {len(again)} drives" if len(again) == len(robot.names("joint")) > 1 else listed(again)
    check, (how, by) = ", ".join(remedy(robot, stopping)), stopping.said
    aside = f"a stop is held: {'; '.join(filter(None, (how, by)))}"
    return Alarm(Kind.ENABLED_AGAIN, "", what, check=check, aside=aside)


def let_go_alarm(robot: Robot, stopping: StopProgress) -> Alarm:
    """Return the alarm of a stop that was confirmed, and that the robot does not hold."""
    check, aside = ", ".join(remedy(robot, stopping)), f"it was {stopping.text.removeprefix('STOP ')}"
    return Alarm(Kind.NOT_HELD, "", LET_GO, did=drives_did(robot), check=check, aside=aside)


def unconfirmed_alarm(robot: Robot, stopping: StopProgress) -> Alarm:
    """Return the alarm; what is to be done stands before its cause."""
    kind, first = unconfirmed(robot), ", ".join(remedy(robot, stopping))
    cause, _, more = stopping.why.partition("; ")
    aside = ""
    if kind is Kind.STILL_MOVING:
        to_do = USE_HARDWARE if stopping.is_outdated else STOP_AGAIN
        what, more, aside = to_do, "", f"the last STOP failed: {_then(stopping.why)}"
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
    """Return what to do where a robot has not stopped, or not stayed so, the first thing first.

    No STOP can be confirmed by a robot whose file cannot be used.
    """
    if stopping.is_outdated:
        return (USE_HARDWARE,)
    if silent_controllers(robot, stopping):
        which = ", ".join(_spoken_node(robot, name) for name in stopping.silent)
        return STOP_AGAIN, KEEP_AT_HAND, f"check {which}"
    if is_live(robot) and not unknown_joints(robot) and not moving_joints(robot):
        return ("STOP again to be sure",)
    return (STOP_AGAIN, f"or {USE_HARDWARE}") if is_live(robot) else (USE_HARDWARE,)


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
