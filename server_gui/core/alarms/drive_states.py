"""What a robot's drives do, as far as is known."""

from collections.abc import Mapping
from typing import Any, Final

from server_gui.core.alarms.marks import ENABLED
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.stop import is_off

MOVES: Final = 0.1  # rad/s: what turns faster is not at rest
FAULTY: Final = ("fault", "fault reaction active")
STATES_S: Final = 5.0  # of an older row nobody says which drives are off; late rows correct it


def moving_joints(robot: Robot) -> list[str]:
    """Return joints whose drive is enabled, or that turn."""
    words = state_words(robot)
    return [
        joint
        for joint in robot.names("joint")
        if words[joint] == ENABLED or abs(robot.values.get(f"{joint}.velocity") or 0.0) > MOVES
    ]


def off_of_late(robot: Robot) -> set[str]:
    """Return the joints whose drive was off in the newest row, where that is not old."""
    age_s = robot.age_s()
    if not robot.is_linked or age_s is None or age_s > STATES_S:
        return set()
    return {joint for joint, word in state_words(robot).items() if is_off(word)}


def drives_did(robot: Robot) -> str:
    """Return in words what the drives do; empty of a robot without any."""
    words = state_words(robot)
    if not words:
        return ""
    if not is_live(robot):
        return "what its drives do now is not known"
    enabled = [joint for joint, word in words.items() if word == ENABLED]
    if unknown := unknown_joints(robot):
        return f"the state of {listed(unknown)} is not known"
    if enabled:
        return f"{len(enabled)} of {len(words)} drives are enabled still"
    states = dict.fromkeys(str(word) for word in words.values())
    return f"no drive is enabled: {', '.join(_counted(words, state, len(states)) for state in states)}"


def _counted(words: Mapping[str, str | None], state: str, states: int) -> str:
    count = list(words.values()).count(state)
    return f"all {count} drives in {state}" if states == 1 else f"{count} {state}"


def device_of(robot: Robot, name: str) -> Mapping[str, Any]:
    """Return what the robot tells of a component's device; nothing where it tells nothing."""
    known = () if robot.description is None else robot.description.components
    device = next((part.device for part in known if part.name == name), None)
    return device if isinstance(device, dict) else {}


def state_words(robot: Robot) -> dict[str, str | None]:
    """Return the state of each joint's drive; None where it is not known."""
    return {joint: robot.word(f"{joint}.state") for joint in robot.names("joint")}


def any_enabled(robot: Robot) -> bool:
    """Return whether some drive is enabled, as far as is known."""
    return ENABLED in state_words(robot).values()


def unknown_joints(robot: Robot) -> list[str]:
    """Return the joints of whose drive nobody knows whether it is enabled."""
    words = state_words(robot)
    return [joint for joint, word in words.items() if word != ENABLED and not is_off(word)]


def is_live(robot: Robot) -> bool:
    """Return whether what is known of it is of now."""
    return robot.is_linked and not robot.is_stale()


def listed(names: list[str]) -> str:
    """Return names for people."""
    return ", ".join(name.replace("_", " ") for name in names)
