"""A robot's worst state as one mark and word: the same on card, header, tables and terminal."""

from typing import Final

from server_gui.core.alarms.alarm import Alarms
from server_gui.core.alarms.marks import Mark, drives_mark
from server_gui.core.follow.robot import Robot

RECORDING: Final = Mark("diamond", "accent", "a recording")


def worst(robot: Robot, alarms: Alarms) -> Mark:
    """Return its worst alarm's mark; without one how its drives are, of a recording that it is one."""
    alarm = alarms.worst
    if alarm is not None:
        return alarm.mark
    return RECORDING if robot.is_recording else drives_mark(robot)
