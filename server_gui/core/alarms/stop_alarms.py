"""What a stop has come to, and how to go on after it."""

from collections.abc import Iterator
from typing import Final

from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.drive_states import any_enabled, drives_did, is_live, state_words
from server_gui.core.alarms.texts import Kind, check_of
from server_gui.core.alarms.unconfirmed import again_alarm, enabled_again, let_go_alarm, unconfirmed_alarm
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.stop import StopProgress, StopState

DRIVES_NOT_KNOWN: Final = "it has told of no drive"
FAULTS_CLEARED: Final = "faults cleared"
EVERY_OFF: Final = "every drive is off"
OFF: Final = frozenset({"switch on disabled"})


def stop_alarms(robot: Robot, stopping: StopProgress) -> Iterator[Alarm]:
    """Yield what there is to say of a stop: not confirmed, held, let go, or ended."""
    if stopping.state is StopState.NOT_CONFIRMED:
        yield unconfirmed_alarm(robot, stopping)
    elif stopping.is_let_go:
        yield let_go_alarm(robot, stopping)
    elif enabled_again(robot, stopping):
        yield again_alarm(robot, stopping)
    elif stopping.held and not (stopping.state is StopState.SENT and any_enabled(robot)):
        what, by = stopping.said
        yield Alarm(
            Kind.STOPPED,
            "",
            what,
            did=_after_stop(robot, stopping),
            check=go_on(Kind.STOPPED, robot),
            since_s=stopping.since_s,
            aside=by,
            why=stopping.problem,
        )
    elif stopping.was_ended and not any_enabled(robot):
        words = set(state_words(robot).values())
        is_every = is_live(robot) and words and words <= OFF
        what = EVERY_OFF if is_every else drives_did(robot) or DRIVES_NOT_KNOWN
        word = FAULTS_CLEARED if stopping.was_fault else ""
        yield Alarm(Kind.RESET, "", what, check=go_on(Kind.RESET, robot), since_s=stopping.since_s, word=word)


def go_on(kind: Kind, robot: Robot) -> str:
    """Return how to go on after a stop, as the robot's gateway may."""
    return check_of(kind, role=role_of(robot), start_by=robot.start_by)


def role_of(robot: Robot) -> str | None:
    """Return the role of the robot's gateway on its buses."""
    return None if robot.description is None else robot.description.role


def _after_stop(robot: Robot, stopping: StopProgress) -> str:
    """Return what the drives' states have shown; where not all have shown it, how they are."""
    shown = set(stopping.proofs) >= set(robot.names("joint")) and not any_enabled(robot)
    every = "all " if len({proof.state for proof in stopping.proofs.values()}) == 1 else ""
    return (
        f"{every}{stopping.proof}" if shown else "; ".join(filter(None, (stopping.proof, drives_did(robot))))
    )
