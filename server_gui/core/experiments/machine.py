"""State machine of an experiment: a table of states by events. Other events are ignored.

Whatever happens after the first write ends in `OVER`, where the device was read to hold the original value
and nothing is on trial, or in `NOT_CONFIRMED`, which is an error. There is no other way out.
"""

from collections.abc import Mapping
from enum import Enum
from typing import Final


class ExperimentState(Enum):
    """State of an experiment; the last three are its ends."""

    LOOKING = "watching the walk before anything is written"
    WRITING = "writing a value on trial"
    HOLDING = "a value is held"
    TAKING_BACK = "taking it back"
    READING = "reading what is held"
    NOTHING_DONE = "nothing was written"
    OVER = "the original value is back"
    NOT_CONFIRMED = "NOT CONFIRMED that the original value is back"

    @property
    def is_end(self) -> bool:
        """Whether nothing more is done."""
        return self in ENDS


class Event(Enum):
    """Event of the state machine."""

    READY = "enough was seen of the walk"
    WRITTEN = "the robot has written and read back"
    REFUSED = "the robot has written nothing"
    UNSURE = "nobody knows whether it was written"
    NEXT = "the value was held for long enough, there is another one"
    LAST = "likewise, and it was the last one"
    HALT = "a stop rule, or somebody, ends it"
    TAKEN = "the robot has answered that it took back"
    NOT_TAKEN = "the robot did not take back, or did not answer"
    ORIGINAL = "the device holds the original value, and nothing is on trial"
    OTHER = "the device holds another one, or something is still on trial"
    UNREAD = "the device could not be read"
    LATE = "what should have come has not come in time"


class Action(Enum):
    """Request to the robot."""

    NONE = 0
    WRITE = "the next value, on trial"
    REVERT = "the write that is on trial"
    RELEASE = "the lease, with which every trial of ours goes back, also one that is on its way"
    READ = "the value that the device holds"


S, E, A = ExperimentState, Event, Action
ENDS: Final = frozenset({S.NOTHING_DONE, S.OVER, S.NOT_CONFIRMED})
# What was written after all is taken back wherever it is heard of.
_WRITTEN_LATE: Final = {
    (state, E.WRITTEN): (S.TAKING_BACK, A.REVERT)
    for state in (S.TAKING_BACK, S.READING, S.OVER, S.NOT_CONFIRMED)
}
TABLE: Final[Mapping[tuple[ExperimentState, Event], tuple[ExperimentState, Action]]] = {
    (S.LOOKING, E.READY): (S.WRITING, A.WRITE),
    (S.LOOKING, E.HALT): (S.NOTHING_DONE, A.NONE),
    (S.LOOKING, E.LATE): (S.NOTHING_DONE, A.NONE),
    (S.WRITING, E.WRITTEN): (S.HOLDING, A.NONE),
    (S.WRITING, E.REFUSED): (S.TAKING_BACK, A.RELEASE),
    (S.WRITING, E.UNSURE): (S.TAKING_BACK, A.RELEASE),
    (S.WRITING, E.HALT): (S.TAKING_BACK, A.RELEASE),
    (S.WRITING, E.LATE): (S.TAKING_BACK, A.RELEASE),
    (S.HOLDING, E.NEXT): (S.WRITING, A.WRITE),
    (S.HOLDING, E.LAST): (S.TAKING_BACK, A.REVERT),
    (S.HOLDING, E.HALT): (S.TAKING_BACK, A.REVERT),
    (S.HOLDING, E.LATE): (S.TAKING_BACK, A.REVERT),
    (S.TAKING_BACK, E.TAKEN): (S.READING, A.READ),
    (S.TAKING_BACK, E.NOT_TAKEN): (S.READING, A.READ),
    (S.TAKING_BACK, E.LATE): (S.READING, A.READ),
    (S.READING, E.ORIGINAL): (S.OVER, A.NONE),
    (S.READING, E.OTHER): (S.READING, A.READ),
    (S.READING, E.UNREAD): (S.READING, A.READ),
    (S.READING, E.LATE): (S.NOT_CONFIRMED, A.NONE),
    **_WRITTEN_LATE,
}


def after(state: ExperimentState, event: Event) -> tuple[ExperimentState, Action]:
    """Return where it stands then, and what is asked; what means nothing there changes nothing."""
    return TABLE.get((state, event), (state, A.NONE))
