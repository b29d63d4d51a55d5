"""What a reset, or a clearing of faults, came to, in words: what is still in fault is no success."""

from collections.abc import Mapping
from typing import Final

from gateway.client import CallTimeout, LinkLost
from gateway.wire.stop import Reset
from server_gui.core.alarms.marks import Mark

RESET_MARK: Final = Mark("ring", "dim", "RESET")  # neither good nor bad: nothing is enabled by it


def after_reset(reset: Reset, next_step: str) -> tuple[str, str]:
    """Return what became of the stop, and the next step where that is over.

    And of drives that have not left fault, with why and what to do, else "".
    """
    stays = {name: why for name, why in reset.problems.items() if "fault" in reset.drives.get(name, "")}
    others = {name: why for name, why in reset.problems.items() if name not in stays}
    in_fault = "; ".join(f"{name} DID NOT LEAVE FAULT: {why}" for name, why in stays.items())
    if reset.held:
        return f"stop still held: {_told(reset.problems)}", in_fault
    if in_fault:
        return "; ".join(
            filter(None, ["no stop is held, but not every fault is cleared", _told(others)])
        ), in_fault
    done = "; ".join(filter(None, ["stop reset, every drive is off", _told(others)]))
    return f"{done}; {next_step}", ""


def without_answer(error: Exception) -> str:
    """Return what is known of a clearing of faults that the robot has not answered, or has refused."""
    is_unknown = isinstance(error, LinkLost | CallTimeout)
    return f"{'Nobody knows whether anything' if is_unknown else 'Nothing'} was cleared: {error}"


def _told(problems: Mapping[str, str]) -> str:
    return "; ".join(f"{name}: {why}" for name, why in problems.items())
