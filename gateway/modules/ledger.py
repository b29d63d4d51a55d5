"""What is kept of one write beyond the process: its entry in the undo file, and what the journal says of it.

Both are durable before the first download and before the answer. Runs in the control module's writer thread.
"""

import logging
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import msgspec

from gateway.modules.transaction import Change
from gateway.records.journal import Journal
from gateway.records.undo import Undo, UndoChange, UndoFile
from gateway.wire import Kind, RpcError, refuse

log = logging.getLogger(__name__)

Place = Callable[[str], tuple[str, int]]  # component → bus, node id


@dataclass(frozen=True, slots=True)
class Keeping:
    """Where all writes of a robot are kept."""

    undo: UndoFile
    journal: Journal
    place: Place
    unusable: str | None = None  # why nothing can be kept


class WriteLedger:
    """One write's. `kept` is what stays to be taken back: a trial, or what a failed roll-back has left."""

    def __init__(
        self, keeping: Keeping, number: int, who: str, changes: list[Change], trial_s: float | None
    ) -> None:
        self.number = number
        self.trial_s = trial_s
        self.kept: Undo | None = None
        self.problem: str | None = None  # why it could not be rolled back
        self.replaced: tuple[Undo, ...] = ()  # trials that this one takes over
        self._keeping = keeping
        self._who = who
        self._changes = changes
        self._undo: Undo | None = None

    def begin(self, before: Mapping[str, bytes]) -> None:
        undo = self._undo = Undo(
            self.number,
            self._who,
            time.time_ns(),
            self.trial_s is not None,
            tuple(self._entry(change, before[change.parameter.name]) for change in self._changes),
        )
        self.replaced = tuple(self._overlapping())
        with self._or_refuse("nothing was written"):
            self._say("write", before=undo.before(), after=undo.values(), trial_s=self.trial_s)
            self._keeping.undo.change(put=[undo])

    def done(self) -> None:
        undo = self._undo
        if undo is None:
            raise RuntimeError("begin() comes before done()")
        trial = self.trial_s is not None
        with self._or_refuse("this write is taken back"):
            self._say("trial begun" if trial else "write done", after=undo.values())
            if not trial:
                self._keeping.undo.change(drop=[self.number])
                return
            self.kept = _merged(undo, self.replaced)
            self._keeping.undo.change(put=[self.kept], drop=[one.write for one in self.replaced])

    def taken_back(self, error: RpcError) -> None:
        self.kept = None
        with suppress(OSError):  # it was logged; a write that is found again will be found unchanged
            self._keeping.undo.change(drop=[self.number])
            self._say("write taken back", result=str(error), outcome=error.data.outcome)

    def left(self, error: RpcError) -> None:
        self.kept = None if self._undo is None else msgspec.structs.replace(self._undo, trial=False)
        self.problem = str(error)
        log.critical("A ROLL-BACK FAILED: %s", error)
        with suppress(OSError):  # it was logged
            if self.kept is not None:
                self._keeping.undo.change(put=[self.kept])
            self._say("ROLL-BACK FAILED", result=str(error), outcome=error.data.outcome)

    def refused(self, error: RpcError) -> None:
        """Nothing was sent; nobody waits for the journal."""
        what = {change.parameter.name: change.parameter.decode(change.data) for change in self._changes}
        self._keeping.journal.append(self._who, "write refused", after=what, result=str(error))

    def _say(self, what: str, **details: object) -> None:
        self._keeping.journal.append(self._who, what, write=self.number, **details).result()

    def _overlapping(self) -> Iterator[Undo]:
        """Trials on the same parameters; only another trial may take them over."""
        names = {change.parameter.name: change.parameter for change in self._changes}
        for other in self._keeping.undo.all():
            shared = [names[name] for name in other.values() if name in names]
            if shared and not other.trial:
                text = f"write {other.write} of {other.who} is still being taken back; wait for that"
                raise shared[0].refusal(Kind.TRIAL_PENDING, text)
            if shared and self.trial_s is None:
                text = f"it is on trial (write {other.write} of {other.who}); confirm or revert that first"
                raise shared[0].refusal(Kind.TRIAL_PENDING, text)
            if shared:
                yield other

    def _entry(self, change: Change, before: bytes) -> UndoChange:
        parameter = change.parameter
        return UndoChange(
            parameter.name,
            parameter.component,
            *self._keeping.place(parameter.component),
            parameter.index,
            parameter.subindex,
            before.hex(),
            change.data.hex(),
            parameter.decode(before),
            parameter.decode(change.data),
        )

    @contextmanager
    def _or_refuse(self, so: str) -> Iterator[None]:
        try:
            if self._keeping.unusable is not None:
                raise OSError(None, self._keeping.unusable)
            yield
        except OSError as error:
            text = f"what is written could not be recorded, {so}: {error.strerror or error}"
            raise refuse(Kind.UNAVAILABLE, text) from error


def _merged(undo: Undo, replaced: tuple[Undo, ...]) -> Undo:
    """A trial with those it takes over: all their parameters, each with its first value before."""
    changes = {change.parameter: change for change in undo.changes}
    for other in reversed(replaced):
        for old in other.changes:
            new = changes.get(old.parameter)
            changes[old.parameter] = (
                old
                if new is None
                else msgspec.structs.replace(new, before=old.before, before_value=old.before_value)
            )
    return msgspec.structs.replace(undo, changes=tuple(changes.values()))
