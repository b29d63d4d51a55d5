"""Reverted trials: reported once the old values have been read back, not before."""

import time
from collections.abc import Mapping
from typing import Final, Protocol

from gateway.wire.method import Number
from server_gui.core.follow.news import NewsKind
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.writing import WriteProgress, WriteState

OVERDUE_S: Final = 2.0  # after its end values are looked at again
OVER: Final = "the trial's time is over"
OTHERS: Final = "taken back, but other values are held: look at them"


class Tell(Protocol):
    """Function that reports news, of what was so long ago."""

    def __call__(self, kind: NewsKind, text: str, *, ago_s: float = 0.0) -> None:
        """Tell it."""


class RevertedTrials:
    """Reverted trials of one robot; `tell` reports their results."""

    def __init__(self, robot: Robot, writing: WriteProgress, tell: Tell) -> None:
        self._robot = robot
        self._writing = writing
        self._tell = tell
        self._awaited: tuple[Mapping[str, Number], int] | None = None

    @property
    def awaited(self) -> frozenset[str]:
        """The parameters whose values are read again: what is known of them is the trial's."""
        return frozenset() if self._awaited is None else frozenset(self._awaited[0])

    def began(self, before: Mapping[str, Number]) -> None:
        """Take the robot's report that these are in force again."""
        self._awaited = before, time.monotonic_ns()
        self._writing.reverting()

    def forget(self) -> None:
        """Something else was written since."""
        self._awaited = None

    def look(self) -> None:
        """Values have come; those that were asked for before the robot's answer may be the trial's still."""
        read_ns = self._robot.parameters_at_ns
        if self._awaited is None or read_ns is None or read_ns <= self._awaited[1]:
            return
        before, at_ns = self._awaited
        if self._robot.holds(before):
            self._awaited = None
            back = f"taken back: {self._writing.held_again(before)}"
            self._writing.reverted(back)
            self._tell(NewsKind.PARAMETER, back)
        elif read_ns - at_ns > OVERDUE_S * 1e9:
            self._awaited = None
            self._writing.say(WriteState.UNKNOWN, OTHERS)
            self._tell(NewsKind.WARNING, OTHERS)

    def look_if_over(self, now_ns: int) -> None:
        """Check whether an expired trial is reverted: the robot must hold the old values again.

        Only values that were read after its end count: a link, or this window, may be slow.
        """
        trial, read_ns = self._writing.trial, self._robot.parameters_at_ns
        if trial is None or read_ns is None or min(now_ns, read_ns) - trial.until_ns < OVERDUE_S * 1e9:
            return
        if self._robot.holds(trial.before):
            back = f"{OVER}, the robot has taken it back: {self._writing.held_again(trial.before)}; see Edits"
            self._writing.reverted(back)
            self._tell(NewsKind.PARAMETER, back, ago_s=(now_ns - trial.until_ns) / 1e9)
        else:
            self._writing.trial = None
            self._writing.say(WriteState.UNKNOWN, f"{OVER}, but other values are held: look at them")
            self._tell(NewsKind.WARNING, self._writing.text)
