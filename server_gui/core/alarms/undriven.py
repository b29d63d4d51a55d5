"""Why a robot does not drive its wearer: what it does then is no sign of anything."""

from typing import Final

from server_gui.core.alarms.drive_states import FAULTY, state_words
from server_gui.core.alarms.unconfirmed import enabled_again
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.stop import StopProgress, StopState, is_off

HELD: Final = "a stop is held"
STOPPING: Final = "drives stop"
IN_FAULT: Final = "a drive is in fault"
NONE_ENABLED: Final = "no drive is enabled"
_QUICK_STOP: Final = "quick stop active"


def undriven(robot: Robot, stopping: StopProgress) -> str:
    """Return why what the robot does now is no sign of anything: it does not drive its wearer."""
    words = [None if word is None else word.lower() for word in state_words(robot).values()]
    is_open = stopping.is_unproven or stopping.state is StopState.SENT
    if stopping.held and not is_open and not enabled_again(robot, stopping):
        return HELD
    if _QUICK_STOP in words:
        return STOPPING
    if any(word in FAULTY for word in words):
        return IN_FAULT
    return NONE_ENABLED if words and all(map(is_off, words)) else ""


def is_driven(robot: Robot, stopping: StopProgress) -> bool:
    """Return whether it may drive its wearer: also where not every drive is known to be in fault or stop."""
    why = undriven(robot, stopping)
    return not why or (why in (STOPPING, IN_FAULT) and not all(map(is_off, state_words(robot).values())))


def is_idle(robot: Robot, stopping: StopProgress) -> bool:
    """Return whether every drive is known to be off, by nothing that has happened."""
    return undriven(robot, stopping) == NONE_ENABLED
