"""Gait events: a foot that comes down or leaves, when that was, and when it was known."""

from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import Final

MAX_GAP_NS: Final = 100_000_000  # samples further apart than this do not belong together
NEW_CLOCK_NS: Final = 1_000_000_000  # a stamp so long before the last is of a robot that was started again


class Leg(StrEnum):
    """Left or right leg."""

    LEFT = "left"
    RIGHT = "right"

    @property
    def other(self) -> "Leg":
        return Leg.RIGHT if self is Leg.LEFT else Leg.LEFT


class EventKind(StrEnum):
    """Heel strike stands for whatever part of the foot comes down first, as on stairs."""

    HEEL_STRIKE = "heel_strike"
    TOE_OFF = "toe_off"


class EventSource(StrEnum):
    """Source of an event, best first."""

    PRESSURE = "pressure"
    FOOT_IMU = "foot_imu"
    KINEMATICS = "kinematics"


@dataclass(frozen=True, slots=True)
class GaitEvent:
    """One event of one foot, on the robot's monotonic clock.

    `known_ns` is the stamp of the sample with which it was decided; `known_ns` − `stamp_ns` is the detector's
    delay. `after_gap` says that events may have been missed just before this one.
    """

    leg: Leg
    kind: EventKind
    stamp_ns: int
    known_ns: int
    after_gap: bool = False


class Follows(Enum):
    """Relation of a sample to the one before."""

    OLD = 0  # not later: it was seen already, or came in the wrong order
    NEXT = 1
    GAP = 2  # it is the first, or follows a gap, or the robot's clock has begun anew


class Continuity:
    """Watches the stamps of one source."""

    def __init__(self) -> None:
        self.last_ns: int | None = None

    def take(self, stamp_ns: int) -> Follows:
        """Take the next sample's stamp."""
        last_ns = self.last_ns
        step_ns = None if last_ns is None else stamp_ns - last_ns
        if step_ns is not None and -NEW_CLOCK_NS < step_ns <= 0:
            return Follows.OLD
        self.last_ns = stamp_ns
        return Follows.NEXT if step_ns is not None and 0 < step_ns <= MAX_GAP_NS else Follows.GAP
