"""A robot's worst state as one mark and word: the same on card, header, tables and terminal."""

from typing import Final

from server_gui.core.alarms.alarm import Alarm, Alarms
from server_gui.core.alarms.marks import Mark, drives_mark
from server_gui.core.alarms.texts import Kind
from server_gui.core.alarms.unconfirmed import enabled_mark
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.stop import StopProgress, StopState

OF_PARTS: Final = frozenset({Kind.FAULT, Kind.IMPLAUSIBLE, Kind.LOST, Kind.PART_STALE, Kind.BEYOND, Kind.HOT})
SHORT_WORDS: Final = {"component stale": "stale", "component silent": "silent"}
RECORDING: Final = Mark("diamond", "accent", "a recording")
STOP_SENT: Final = Mark("half", "warn", "STOP sent")


def named(alarm: Alarm) -> Mark:
    """Return an alarm's mark; of a part of the robot with its name: `left insole lost`.

    Its other parts may be well, and stand beside it as they are.
    """
    mark = alarm.mark
    if alarm.kind not in OF_PARTS or not alarm.spoken:
        return mark
    return Mark(mark.shape, mark.colour, f"{alarm.spoken} {SHORT_WORDS.get(mark.word, mark.word)}")


def worst(robot: Robot, alarms: Alarms, stopping: StopProgress) -> Mark:
    """Return its worst alarm's mark; without one how its drives are, of a recording that it is one.

    A STOP that nobody has answered yet stands before all that is not bad.
    """
    alarm = alarms.worst
    if stopping.state is StopState.SENT and (alarm is None or alarm.mark.colour != "bad"):
        return STOP_SENT
    if alarm is not None:
        return named(alarm)
    return RECORDING if robot.is_recording else drives_mark(robot, enabled_mark(robot, stopping))
