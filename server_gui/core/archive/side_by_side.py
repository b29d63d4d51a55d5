"""A second recording beside the one that is played, aligned by a heel strike or by their beginnings."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from enum import Enum
from typing import Any, Final, NamedTuple

import numpy as np

from ml.store import StoreError
from ml.store.sessions import Session
from server_gui.core.archive.playback import LEAD_NS, Piece, Playback, PlayedRobot
from server_gui.core.cloud.tape import Tape
from server_gui.core.desk.desk import Shown
from server_gui.core.desk.flags import Flag
from server_gui.core.desk.station import Station
from server_gui.core.processing.gait_events import EventKind, GaitEvent, Leg
from server_gui.core.processing.recording import summarise
from server_gui.core.processing.wiring import Wiring
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.settings.server_file import ServerSettings
from server_gui.core.threads.answers import Deliver, when_done

AGAIN_S: Final = 5.0  # before what could not be read is tried again
SEARCHED_NS: Final = 60_000_000_000  # of each, for its first heel strike
NO_STEPS: Final = "no left heel strike in the first minute of both: aligned by their beginnings"
NOT_READ: Final = "their first steps could not be read: aligned by their beginnings"
CLOSED: Final = "the first recording was closed while this one was read"
Do = Callable[[Callable[[], Any]], "Future[Any]"]


class By(Enum):
    """What of both is at one place; the word is shown."""

    START = "their beginnings"
    FIRST_STRIKE = "the first left heel strike"
    LAST_STRIKE = "the last left heel strike"


class Followed(Playback):
    """Is always where it is told to be, and has no time of its own; what cannot be read is tried again.

    Before its beginning it has no rows: its first one is not of that instant.
    """

    def __init__(
        self, read: Do, deliver: Deliver, shown: Shown, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(read, deliver, shown)
        self._clock_s = clock_s
        self._again_s: float | None = None  # not before that

    def try_again(self) -> None:
        """Read at once what could not be read."""
        self._again_s = None

    def close(self) -> None:
        """Show nothing more."""
        super().close()
        self.try_again()

    def follow(self, target_ns: int) -> None:
        """Show this instant; what is after its end is shown as the past that it is."""
        tape = self.tape
        if tape is None:
            return
        if target_ns < tape.first_ns:
            self._wait(tape)
            return
        within_ns = min(target_ns, tape.last_ns)
        fed_ns = self._fed_ns
        if fed_ns is not None and not fed_ns <= within_ns <= fed_ns + LEAD_NS:
            self.seek(within_ns)
            self.try_again()
        if self._show_until(tape, within_ns):
            self.position_ns = within_ns
            self._robot.shown_ns = target_ns
        elif self.problem:
            self._robot.row_ns = None  # what is shown still is of another instant: it has no age here

    def _wait(self, tape: Tape) -> None:
        """Show no row, and read the first ones."""
        if self._fed_ns is not None or self._robot.description is None:
            self._begin_anew(tape)
            self._fed_ns = None
        self.position_ns = tape.first_ns
        self._fetch(tape, None if 0 in self._pieces else 0)

    def _fetch(self, tape: Tape, place: int | None) -> None:
        if self._again_s is None or self._clock_s() >= self._again_s:
            super()._fetch(tape, place)

    def _fetched(self, tape: Tape, place: int, piece: Piece) -> None:
        super()._fetched(tape, place, piece)
        if tape is self.tape:
            self.problem, self._again_s = "", None

    def _failed(self, tape: Tape, error: Exception) -> None:
        super()._failed(tape, error)
        if tape is self.tape:
            self.problem = self.problem or type(error).__name__
            self._again_s = self._clock_s() + AGAIN_S


class Opened(NamedTuple):
    """A second recording, and the first left heel strikes of both (UTC, ns), None where one lacks it."""

    tape: Tape
    strikes_ns: tuple[int, int] | None
    problem: str  # why there are none


class SideBySide:
    """For the window's thread; `second` is beside `playback`, from whose beginning `offset_ns` is counted."""

    def __init__(
        self,
        playback: Playback,
        settings: ServerSettings,
        do: Do,
        deliver: Deliver,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.second = Followed(do, deliver, playback.desk.shown, clock_s)
        self.session: Session | None = None  # what is beside, or is looked into
        self.by = By.START
        self.remark = ""  # why they are not aligned by a heel strike
        self._strikes_ns: tuple[int, int] | None = None
        self._not_opened = ""  # why
        self._wishes = playback.wishes  # of the first, that the second has followed
        self._offset_ns = 0  # of the second's instants after those of the first
        self.first = playback
        self._settings = settings
        self._do = do
        self._deliver = deliver

    def open(self, session: Session) -> None:
        """Put this one beside what is played, once it has been looked into."""
        self.close()
        self.session, first = session, self.first.tape
        when_done(
            self._do(lambda: _opened(self._settings, session, first)),
            self._deliver,
            lambda opened: self._opened(session, opened),
            lambda error: self._failed(session, error),
        )

    def close(self) -> None:
        """Put it away."""
        self.session, self._not_opened, self.by = None, "", By.START
        self.remark, self._strikes_ns = "", None
        self.second.close()

    @property
    def problem(self) -> str:
        """Why it is not shown, or not now; empty where it is."""
        return self._not_opened or self.second.problem

    @property
    def station(self) -> Station | None:
        """What is beside, once it is there."""
        return self.second.desk.selected

    @property
    def flags(self) -> Sequence[Flag]:
        """What happened in it, on the axis of the first."""
        if self.second.tape is None:
            return ()
        return [replace(one, at_ns=one.at_ns - self._offset_ns) for one in self.second.happened.flags]

    def step(self) -> None:
        """Show what is at the instant of the first; a jump of it, or its *play*, tries what failed again."""
        if self.first.wishes != self._wishes:
            self._wishes = self.first.wishes
            self.second.try_again()
        self.second.follow(self.first.position_ns + self._offset_ns)

    def align(self, by: By) -> str:
        """Align them; why that is not possible, else empty, and then nothing has changed."""
        first, second = self.first.tape, self.second.tape
        if first is None or second is None:
            return "the second recording is still read"
        instants = self._instants_ns(by, first, second)
        if instants is None:
            is_last = by is By.LAST_STRIKE
            up_to = "up to here: go on a little" if is_last else "in its first minute"
            return f"no left heel strike is known in one of them {up_to}"
        ours, theirs = instants
        self._offset_ns, self.by, self.remark = theirs - ours, by, ""
        return ""

    def _instants_ns(self, by: By, first: Tape, second: Tape) -> tuple[int, int] | None:
        """Return the instants of both that are aligned, UTC; None where one lacks it."""
        if by is By.START:
            return first.first_ns, second.first_ns
        if by is By.FIRST_STRIKE:
            return self._strikes_ns
        ours, theirs = (_last_strike_ns(one.desk.selected) for one in (self.first, self.second))
        return None if ours is None or theirs is None else (ours, theirs)

    def _opened(self, session: Session, opened: Opened) -> None:
        first = self.first.tape
        if session is not self.session:
            return
        if first is None:
            self.session, self._not_opened = None, CLOSED
            return
        self.second.open(opened.tape)
        self._strikes_ns = opened.strikes_ns
        self.align(By.START if opened.strikes_ns is None else By.FIRST_STRIKE)
        self.remark = opened.problem

    def _failed(self, session: Session, error: Exception) -> None:
        if session is self.session:
            self._not_opened = str(error) or type(error).__name__


def _opened(settings: ServerSettings, session: Session, first: Tape | None) -> Opened:
    """Look into the second, and for the first left heel strike of both; blocks. Raises as `Tape.open`."""
    second = Tape.open(settings, session)
    if first is None:
        return Opened(second, None, "")
    try:
        ours, theirs = _first_strike_ns(first), _first_strike_ns(second)
    except (StoreError, SpoolUnusable):
        return Opened(second, None, NOT_READ)
    if ours is None or theirs is None:
        return Opened(second, None, NO_STEPS)
    return Opened(second, (ours, theirs), "")


def _first_strike_ns(tape: Tape) -> int | None:
    """Return the first one of the left leg in its first minute, UTC; blocks. Raises as `Tape.open`."""
    wanted = Wiring.of([*tape.units]).channels
    rows = tape.read(tape.first_ns, tape.first_ns + SEARCHED_NS, sorted(wanted))
    found = [one.stamp_ns for one in summarise(rows.stamps_ns, rows.columns).events if _is_left_strike(one)]
    if not found:
        return None
    row = min(int(np.searchsorted(rows.stamps_ns, min(found))), len(rows.stamps_ns) - 1)
    return min(found) + int(rows.utc_ns[row] - rows.stamps_ns[row])  # its own: UTC may be set meanwhile


def _is_left_strike(event: GaitEvent) -> bool:
    return event.kind is EventKind.HEEL_STRIKE and event.leg is Leg.LEFT


def _last_strike_ns(station: Station | None) -> int | None:
    """Return the last one of the left leg, UTC."""
    robot = None if station is None else station.robot
    if (
        station is None
        or not isinstance(robot, PlayedRobot)
        or robot.row_ns is None
        or robot.stamp_ns is None
    ):
        return None
    found = [one.stamp_ns for one in station.processing.derived().events if _is_left_strike(one)]
    return max(found) + robot.row_ns - robot.stamp_ns if found else None
