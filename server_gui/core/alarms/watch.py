"""A robot's alarms as of now: judged once in a moment, whoever asks."""

import dataclasses
from collections.abc import Callable

from server_gui.core.alarms.alarm import Alarms
from server_gui.core.alarms.beyond import Beyond
from server_gui.core.alarms.causes import Stalls, gathered
from server_gui.core.alarms.drive_states import any_enabled, is_live
from server_gui.core.alarms.robot_alarms import Facts, alarms
from server_gui.core.alarms.undriven import is_idle
from server_gui.core.follow.frame_time import FrameTime, this_moment


class AlarmWatch:
    """Knows when its computer stood still and what is beyond limits; `facts` tells the rest.

    `newest_ns` is the time of its newest row, on the axis of the signals.
    """

    def __init__(self, facts: Callable[[], Facts], newest_ns: Callable[[], int | None]) -> None:
        self._facts, self._newest_ns = facts, newest_ns
        self.stalls = Stalls()
        self.beyond = Beyond()
        self.found = Alarms()  # as they were judged last
        self._judged: FrameTime | None = None  # by which moment, since anything has come

    def again(self) -> None:
        """Judge with the next look: something has come."""
        self._judged = None

    def look(self) -> Alarms:
        """Judge what there is to know, once in a moment."""
        if (moment := this_moment()) is None or moment is not self._judged:
            self._judge(self._facts())
            self._judged = moment  # by all of it: what raises half-way is looked for again
        return self.found

    def _judge(self, known: Facts) -> None:
        robot, stopping, stalls, now_s = known.robot, known.stopping, self.stalls.latest, known.robot.now_s()
        beyond = self.beyond.look(robot, is_off=is_idle(robot, stopping))
        facts = dataclasses.replace(known, stalls=stalls, beyond=beyond)
        if (stopping.was_ended or stopping.proofs) and any_enabled(robot) and is_live(robot):
            stopping.goes_on()
        self.found.look(
            alarms(facts),
            now_s,
            self._newest_ns(),
            lambda active: gathered(active, stalls, now_s, len(robot.parts)),
        )
