"""A reset, or a clearing of faults, and what it came to, in words: what is still in fault is no success."""

from collections.abc import Callable, Mapping
from typing import Final

from gateway.client import CallTimeout, LinkLost
from gateway.wire.stop import Reset
from server_gui.core.alarms.marks import Mark
from server_gui.core.alarms.stop_alarms import go_on
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.news import NewsKind
from server_gui.core.follow.robot import Robot
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.tuning.commands import Commands
from server_gui.core.tuning.stop import StopProgress, StopState

RESET_MARK: Final = Mark("ring", "dim", "RESET")  # neither good nor bad: nothing is enabled by it


class Resetting:
    """Resets one robot; `tell` reports what came of it."""

    def __init__(
        self,
        commands: Commands,
        deliver: Deliver,
        robot: Robot,
        stopping: StopProgress,
        tell: Callable[[NewsKind, str], None],
    ) -> None:
        self._commands, self._deliver = commands, deliver
        self._robot, self._stopping, self._tell = robot, stopping, tell

    def begin(self, failed: Callable[[str], None]) -> None:
        """End a held stop, clear faults; enables nothing. `failed` is told what is still in fault."""
        number = self._stopping.number

        def refused(error: Exception) -> None:
            self._tell(NewsKind.WARNING, f"reset: {error}")
            failed(without_answer(error))

        when_done(
            self._commands.reset(), self._deliver, lambda reset: self._done(number, reset, failed), refused
        )

    def _done(self, number: int, reset: Reset, failed: Callable[[str], None]) -> None:
        is_asked = self._stopping.state is StopState.SENT  # what is not answered is not reset
        if is_asked or number != self._stopping.number:  # the journal tells which of them was last
            self._tell(NewsKind.STOP, "reset: a STOP was sent meanwhile, which counts")
            return
        self._stopping.was_reset(reset.held)
        next_step = go_on(Kind.RESET, self._robot)
        said, stays = after_reset(reset, next_step, of_faults=self._stopping.was_fault)
        self._tell(NewsKind.STOP if reset.held or stays else NewsKind.RESET, said)
        if stays:
            self._tell(NewsKind.FAULT, stays)
            failed(stays)


def after_reset(reset: Reset, next_step: str, *, of_faults: bool = False) -> tuple[str, str]:
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
    ended = "faults cleared" if of_faults else "stop reset"
    done = "; ".join(filter(None, [f"{ended}, every drive is off", _told(others)]))
    return f"{done}; {next_step}", ""


def without_answer(error: Exception) -> str:
    """Return what is known of a clearing of faults that the robot has not answered, or has refused."""
    is_unknown = isinstance(error, LinkLost | CallTimeout)
    return f"{'Nobody knows whether anything' if is_unknown else 'Nothing'} was cleared: {error}"


def _told(problems: Mapping[str, str]) -> str:
    return "; ".join(f"{name}: {why}" for name, why in problems.items())
