"""Writes under way, what came of them, trials that count down, and what undo would write."""

import collections
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from gateway.client import NotConnected, RemoteError
from gateway.units import Unit
from gateway.wire.method import Number
from gateway.wire.parameter import Written
from server_gui.core.follow import frame_time
from server_gui.core.tuning.edits import ReviewedEdit, spoken

TOLD: Final = 2  # values that are said one by one
UNDO: Final = 100  # writes that can be taken back one after another
UNSURE: Final = (
    "device_timeout",
    "mismatch",
    "rollback_failed",
)  # refusals after which a device may hold anything
OUTCOMES: Final = "outcome"  # what a refusal says became of each parameter


class WriteState(Enum):
    """State of the latest write."""

    IDLE = "nothing was written"
    WRITING = "writing"
    DONE = "written and read back"
    FAILED = "not written"
    NOT_STORED = "not stored"
    UNKNOWN = "NOT KNOWN"  # the link or the answer was lost: it may have been written


@dataclass(frozen=True, slots=True)
class Trial:
    """A write that the robot takes back by itself at `until_ns` (our monotonic clock)."""

    write: int
    values: Mapping[str, Number]
    before: Mapping[str, Number]
    until_ns: int

    def left_s(self, now_ns: int | None = None) -> float:
        """Return seconds until it reverts, never below 0."""
        return max(0, self.until_ns - (frame_time.now_ns() if now_ns is None else now_ns)) / 1e9


@dataclass(slots=True)
class WriteProgress:
    """One robot's writes; `rows` says of each parameter what came of the latest write to it."""

    state: WriteState = WriteState.IDLE
    text: str = ""
    said_s: float = 0.0  # when, on our monotonic clock
    rows: dict[str, str] = field(default_factory=dict)
    trial: Trial | None = None
    failed_ask: str = ""  # what of a trial was asked for and not done: to keep it, or take it back
    why_failed: str = ""
    asks: int = 0  # of that kind, so far
    undo: collections.deque[Mapping[str, Number]] = field(
        default_factory=lambda: collections.deque(maxlen=UNDO)
    )
    revision: int = 0
    units: dict[str, Unit] = field(default_factory=dict)  # in which each was reviewed

    def began(self, changes: tuple[ReviewedEdit, ...]) -> None:
        """Note that these were sent."""
        self._set(WriteState.WRITING, f"writing {_count(len(changes))} …")
        for change in changes:
            self.rows.pop(change.name, None)
            self.units[change.name] = change.unit

    def held_again(self, before: Mapping[str, Number]) -> str:
        """Return in words what was read back after a trial: `step length (gait) is 400 mm again`."""
        said = [
            f"{spoken(name)} is {unit.editable(before[name])} {unit.symbol}".rstrip()
            for name, unit in self.units.items()
            if name in before
        ]
        if len(said) < len(before):
            return "the values from before are held again"
        more = f" and {len(said) - TOLD} more are" if len(said) > TOLD else ""
        return f"{', '.join(said[:TOLD])}{more} again"

    def done(self, written: Written) -> None:
        """Take the values that the robot has written and read back."""
        if written.trial_s is None:
            self.undo.append(written.before)
            self._set(WriteState.DONE, f"{_count(len(written.after))} written and read back")
        else:
            until_ns = time.monotonic_ns() + round(written.trial_s * 1e9)
            self.failed_ask = self.why_failed = ""
            self.trial = Trial(written.write, written.after, written.before, until_ns)
            self._set(WriteState.DONE, "on trial: read back, and in force until it is taken back")

    def storing(self, component: str) -> None:
        """Note that a device was asked to store."""
        self._set(WriteState.WRITING, f"{component} is storing to its flash …")

    def failed(self, changes: tuple[ReviewedEdit, ...], error: Exception) -> None:
        """Take a failed write: refused, rolled back or unknown, with the outcome of each row."""
        refused = isinstance(error, RemoteError) and error.kind not in UNSURE
        nothing_done = refused or isinstance(error, NotConnected)
        self._set(WriteState.FAILED if nothing_done else WriteState.UNKNOWN, str(error))
        said = error.data.get(OUTCOMES) if isinstance(error, RemoteError) else None
        for change in changes:
            told = said.get(change.name) if isinstance(said, Mapping) else None
            self.rows[change.name] = str(told) if told is not None else str(error)

    def kept(self) -> None:
        """Note that the trial was confirmed."""
        if self.trial is not None:
            self.undo.append(self.trial.before)
            self._end_trial("kept: the trial's values stay")

    def asked(self) -> int:
        """Note that a trial is to be kept, or taken back; return the number of this wish."""
        self.failed_ask = self.why_failed = ""
        self.revision += 1
        self.asks += 1
        return self.asks

    def not_done(self, what: str, why: str) -> None:
        """Note that the robot did not, or has not said that it did: the trial goes on, as far as is known."""
        if self.trial is not None:
            self.failed_ask, self.why_failed = what, why
            self.revision += 1

    def reverting(self) -> None:
        """Note a revert that the robot reports, before it is read back."""
        self.trial = None
        self._set(WriteState.WRITING, "taken back: the values shown are read again …")

    def reverted(self, how: str) -> None:
        """Note that the trial was reverted."""
        self._end_trial(how)

    def say(self, state: WriteState, text: str) -> None:
        """Add another message."""
        self._set(state, text)

    def _end_trial(self, text: str) -> None:
        self.trial = None
        self._set(WriteState.DONE, text)

    def _set(self, state: WriteState, text: str) -> None:
        self.state, self.text, self.said_s = state, text, time.monotonic()
        self.revision += 1


def _count(number: int) -> str:
    return f"{number} parameter" if number == 1 else f"{number} parameters"


def written_line(change: ReviewedEdit, written: Written) -> str:
    """Return one change of a write as it was read back."""
    before, after = written.before.get(change.name), written.after.get(change.name)
    unit = change.unit
    old = "?" if before is None else unit.editable(before)
    new = "?" if after is None else unit.editable(after)
    return f"{spoken(change.name)} {old} → {new} {unit.symbol}".rstrip()
