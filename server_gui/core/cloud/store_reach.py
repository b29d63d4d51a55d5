"""Whether the store is reached: decided here, for the strip of alarms and for every page that needs it."""

import time
from collections.abc import Callable
from enum import Enum
from typing import Final

from gateway.amounts import NONE

LOOK_S: Final = 15.0  # between two looks at a store that was reached
AGAIN_S: Final = 5.0  # before one that was away is tried again
AGAIN: Final = "retried automatically"  # as every page says it
KNOWN_S: Final = 60.0  # after a look: longer than one of S3 that fails, later nobody knows


class Reach(Enum):
    """Reach of the store."""

    NOT_LOOKED = "not looked at yet"
    REACHED = "reached"
    EMPTY = "nothing uploaded yet"
    AWAY = "not reached"
    UNREADABLE = "reached, but its list cannot be read"
    FAILING = "an upload failed"
    OLD = "not known"


class StoreReach:
    """Result of the newest check, by whomever; for the window's thread.

    Whether it is reached, and whether its list can be read, are two facts: one small file tells the first.
    """

    def __init__(self, clock_s: Callable[[], float] = time.monotonic) -> None:
        self.problem: str | None = None  # why it is not reached; stays until a look says otherwise
        self.list_problem: str | None = None  # why its list cannot be read; stays until that was read
        self.upload_problem: str | None = None  # why nothing goes into it, as whoever records says
        self.looked_s: float | None = None  # on our monotonic clock
        self.on_return: list[Callable[[], None]] = []  # called when it is reached after it was not
        self._is_empty = False
        self._is_doubted = False
        self._clock_s = clock_s

    @property
    def state(self) -> Reach:
        """What is known now; what was last seen to be away is so until it is seen again."""
        if self.problem is not None:
            return Reach.AWAY
        if self.list_problem is not None:
            return Reach.UNREADABLE
        if self.upload_problem is not None:
            return Reach.FAILING
        if self.looked_s is None:
            return Reach.NOT_LOOKED
        if self.age_s > KNOWN_S:
            return Reach.OLD
        return Reach.EMPTY if self._is_empty else Reach.REACHED

    @property
    def trouble(self) -> str | None:
        """Why it cannot be relied on, whoever has noticed; None where nobody has."""
        known = (self.problem, self.list_problem, self.upload_problem)
        return next((problem for problem in known if problem is not None), None)

    @property
    def age_s(self) -> float:
        """How long ago somebody has looked; of what nobody has looked at, no time."""
        return 0.0 if self.looked_s is None else self._clock_s() - self.looked_s

    @property
    def is_known(self) -> bool:
        """Whether it may be called well."""
        return self.state in (Reach.REACHED, Reach.EMPTY)

    @property
    def said(self) -> str:
        """Return it in a sentence for people."""
        return {
            Reach.NOT_LOOKED: "Looking for the first time …",
            Reach.REACHED: f"Reached; looked {self.age_s:.0f} s ago",
            Reach.EMPTY: f"There is no store at this URL yet (looked {self.age_s:.0f} s ago)",
            Reach.AWAY: f"Not reached, {AGAIN}: {self.problem or NONE}",
            Reach.UNREADABLE: f"Reached, but its list cannot be read: {self.list_problem or NONE}",
            Reach.FAILING: f"An upload failed, {AGAIN}: {self.upload_problem or NONE}",
            Reach.OLD: f"Not known: the newest answer came {self.age_s:.0f} s ago",
        }[self.state]

    @property
    def is_due(self) -> bool:
        """Whether it is time for somebody to look."""
        wait_s = LOOK_S if self.problem is None and self.list_problem is None else AGAIN_S
        return self._is_doubted or self.looked_s is None or self.age_s >= wait_s

    def looked(self, problem: str | None, *, is_empty: bool = False) -> None:
        """Take whether it was reached."""
        was_away, self.problem = self.problem is not None, problem
        self.looked_s, self._is_empty, self._is_doubted = self._clock_s(), is_empty, False
        if was_away and problem is None:
            for told in self.on_return:
                told()

    def listed(self, problem: str | None) -> None:
        """Take whether the list of a store that was reached could be read."""
        self.list_problem = problem

    def uploads(self, problem: str | None) -> None:
        """Take how uploading goes; where that has changed, it is time to look."""
        self._is_doubted |= (problem is None) != (self.upload_problem is None)
        self.upload_problem = problem
