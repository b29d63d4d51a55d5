"""Stop, reset and enabling."""

from typing import Any, Literal

from msgspec import Struct

from gateway.wire.method import Globs, Method, Params
from gateway.wire.role import Role

StopOutcome = Literal["confirmed", "unconfirmed", "unreachable"]


class StopParams(Struct, frozen=True):
    """`robot.stop`; takes whatever it is given, because a stop is never refused for its form."""

    reason: Any = ""


class Stopped(Struct, frozen=True):
    """Result of `robot.stop`: what is known when all have confirmed, or the time for an answer is over."""

    drives: dict[str, StopOutcome]
    held: bool
    controllers: dict[str, StopOutcome] = {}  # of `[[stop.controller]]`
    fallbacks: dict[str, str] = {}  # drive → what was carried out beyond the quick stop, in words
    problem: str | None = None  # why the stop is not held beyond this gateway
    outdated: str | None = None  # why drives may be missing here, and move: the robot's file cannot be used


class Reset(Struct, frozen=True):
    """Result of `robot.reset`: each drive's state in words; `problems` says which were not led there."""

    drives: dict[str, str]
    problems: dict[str, str]
    held: bool


class EnableParams(Params, frozen=True):
    """`robot.enable`; `joints` are globs, none means all."""

    joints: Globs | None = None


class Enabled(Struct, frozen=True):
    """Result of `robot.enable`: each drive's state in words, and which were not led there, and why.

    Where there are problems, every drive that was begun has been stopped again. `modes` are those that the
    drives were enabled in, in words.
    """

    drives: dict[str, str]
    problems: dict[str, str]
    modes: dict[str, str] = {}


class DriveReaction(Struct, frozen=True):
    """One drive's own reactions: option codes as the drive holds them, `None` if they are unknown."""

    quick_stop_option: int | None = None  # 605Ah
    abort_connection_option: int | None = None  # 6007h
    armed: bool = False  # whether it stops by itself when the gateway dies
    quick_stop: str | None = None  # the first in words
    abort_connection: str | None = None  # the second in words


class StopInfo(Struct, frozen=True):
    """Settings of the stop on this robot, and whether one is held now."""

    held: bool
    reason: str | None
    since_ns: int | None
    stopped_again: dict[str, int]  # drive → how often somebody enabled it while the stop was held
    drives: dict[str, DriveReaction]
    fallbacks: list[str] = []  # what follows, in words, where a drive does not confirm its quick stop
    controllers: dict[str, str | None] = {}  # that a stop goes to as well; why it cannot, `None` where it can
    problem: str | None = None  # why the held stop will not outlive this gateway


ROBOT_STOP = Method("robot.stop", StopParams, Stopped, module="control", urgent=True, role=Role.VIEWER)
ROBOT_RESET = Method("robot.reset", Params, Reset, module="control", needs_lease=True, role=Role.MAINTAINER)
ROBOT_ENABLE = Method(
    "robot.enable", EnableParams, Enabled, module="control", needs_lease=True, role=Role.MAINTAINER
)
METHODS = (ROBOT_STOP, ROBOT_RESET, ROBOT_ENABLE)
