"""The durable record of one write: its entry in the undo file, and its lines in the journal.

The entry is durable first, and its end is told before it goes: whatever the journal says was begun has its
end there, also where the gateway was killed in between; then the next one tells it. Both are durable before
the first download and before the answer. Runs in the writer's thread.
"""

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress

import msgspec

from gateway.modules.control.objects import ObjectWrite
from gateway.modules.control.parameters import Parameter
from gateway.modules.stop.authority import Address
from gateway.records.journal import Share
from gateway.records.records import Records
from gateway.records.undo import Undo, UndoChange
from gateway.wire.framing import ErrorKind, RpcError, refuse

log = logging.getLogger(__name__)


class WriteLedger:
    """One write's; on trial where `trial_s` is given."""

    def __init__(
        self,
        records: Records,
        address: Callable[[Parameter], Address],
        number: int,
        who: str,
        trial_s: float | None,
    ) -> None:
        self.number = number
        self.trial_s = trial_s
        self.problem: str | None = None  # why it could not be rolled back
        self.changes: tuple[UndoChange, ...] = ()  # what is to be taken back where it fails
        self.taken_over: tuple[int, ...] = ()  # trials
        self.undos = records.undo
        self._journal = records.journal
        self._address = address
        self._who = who

    @property
    def kept(self) -> Undo | None:
        """The entry in the undo file: on trial, or left by a failed roll-back."""
        return self.undos.get(self.number)

    def replaced(self, changes: Sequence[ObjectWrite]) -> tuple[Undo, ...]:
        """Return the trials on the same parameters, which only another trial takes over.

        Raises:
            RpcError: trial_pending; it is none, or they are being taken back.

        """
        names = {change.name: change.parameter for change in changes}
        found = []
        for other in self.undos.all():
            shared = [names[name] for name in other.values() if name in names]
            if not shared or other.write == self.number:
                continue
            if not other.trial:
                text = f"write {other.write} of {other.who} is still being taken back; wait for that"
                raise shared[0].refusal(ErrorKind.TRIAL_PENDING, text)
            if self.trial_s is None:
                text = f"it is on trial (write {other.write} of {other.who}); confirm or revert that first"
                raise shared[0].refusal(ErrorKind.TRIAL_PENDING, text)
            found.append(other)
        return tuple(found)

    def goal(self, change: ObjectWrite, before: bytes) -> bytes | None:
        """Return the value to which the end of this trial would revert a parameter."""
        if self.trial_s is None:
            return None
        trials = self.replaced([change])
        goals = {one.parameter: one.before for other in trials for one in other.changes}
        return bytes.fromhex(goals.get(change.name, before.hex()))

    def begin(self, changes: Sequence[ObjectWrite], before: Mapping[str, bytes]) -> None:
        """Note it before the first download; raises `RpcError` if it cannot: then nothing is written."""
        self.changes = tuple(self._entry(change, before[change.name]) for change in changes)
        undo = Undo(self.number, self._who, time.time_ns(), self.trial_s is not None, self.changes)
        with self._or_refuse("nothing was written"):
            self.undos.change(put=[undo])
            self._say("write", Share.ASKED, before=undo.before(), after=undo.values(), trial_s=self.trial_s)

    def refused(self, changes: Sequence[ObjectWrite], error: RpcError) -> None:
        """Nothing was sent; nobody waits for the journal."""
        self.undos.leave(self.number, ())
        what = {change.name: change.parameter.decode(change.data) for change in changes}
        self._journal.append(self._who, "write refused", Share.ASKED, after=what, result=str(error))

    def made(self, name: str, data: bytes) -> None:
        """Note that the device altered the written value, which must still be reverted."""
        self.changes = _made(self.changes, name, data)
        if self.kept is not None:
            kept = msgspec.structs.replace(self.kept, changes=_made(self.kept.changes, name, data))
            self.undos.settle(put=[kept])

    def done(self) -> None:
        """Everything is written and verified; raises `RpcError` where that cannot be kept."""
        after = {change.parameter: change.written_value for change in self.changes}
        with self._or_refuse("this write is taken back"):
            if self.trial_s is None:
                self._say("write done", after=after)
                self.undos.change(drop=[self.number])
            else:
                self._say("trial begun", after=after)
                self._take_over()

    def _take_over(self) -> None:
        undo = self.kept
        if undo is None:
            return
        names = set(undo.values())
        replaced = [one for one in self.undos.all() if one is not undo and names & set(one.values())]
        self.undos.change(put=[_merged(undo, replaced)], drop=[one.write for one in replaced])
        self.taken_over = tuple(one.write for one in replaced)

    def rolled_back(self, error: RpcError, left: tuple[UndoChange, ...]) -> None:
        """Note the failure, and the values that must still be reverted."""
        failed = error.kind is ErrorKind.ROLLBACK_FAILED
        if failed:
            self.problem = str(error)
            log.critical("A ROLL-BACK FAILED: %s", error)
        with suppress(OSError):  # it was logged, and does not change what was done
            what = "ROLL-BACK FAILED" if failed else "write taken back"
            self._say(what, result=str(error), outcome=error.data.outcome)
        self.undos.leave(self.number, left)

    def _say(self, what: str, share: Share = Share.OUTCOME, /, **details: object) -> None:
        self._journal.append(self._who, what, share, write=self.number, **details).result()

    def _entry(self, change: ObjectWrite, before: bytes) -> UndoChange:
        parameter = change.parameter
        return UndoChange(
            parameter.name,
            parameter.component,
            *self._address(parameter),
            before.hex(),
            change.data.hex(),
            parameter.decode(before),
            parameter.decode(change.data),
        )

    @contextmanager
    def _or_refuse(self, so: str) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            text = f"what is written could not be recorded, {so}: {error.strerror or error}"
            raise refuse(ErrorKind.UNAVAILABLE, text) from error


def _made(changes: Sequence[UndoChange], name: str, data: bytes) -> tuple[UndoChange, ...]:
    return tuple(
        msgspec.structs.replace(one, made=data.hex()) if one.parameter == name else one for one in changes
    )


def _merged(undo: Undo, replaced: Sequence[Undo]) -> Undo:
    """Return a trial with those it takes over: all their parameters, each with its first value before.

    In the order of their last downloads, so that the last one is taken back first.
    """
    first = {one.parameter: one for other in replaced for one in other.changes}
    names = undo.values()
    older = [one for name, one in first.items() if name not in names]
    newer = [_from_first(one, first.get(one.parameter, one)) for one in undo.changes]
    return msgspec.structs.replace(undo, changes=(*older, *newer))


def _from_first(change: UndoChange, first: UndoChange) -> UndoChange:
    return msgspec.structs.replace(change, before=first.before, before_value=first.before_value)
