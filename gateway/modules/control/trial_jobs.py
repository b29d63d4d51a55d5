"""The end of a write on trial: confirmed, reverted, or claimed by a stop. In the writer's thread.

One job after another decides it, by the undo file: who comes first, the confirmation or the end of its time,
wins.
"""

import logging
from functools import partial

import msgspec

from drivers.errors import DriverError
from gateway.modules.control.objects import result
from gateway.modules.control.reverting import CLAIMED, Attempt, TakenBack
from gateway.modules.control.rules import OutOfReach, Rules
from gateway.modules.control.writer import Turn, Writer
from gateway.modules.stop.authority import Authority
from gateway.process.futures import outcome
from gateway.records.journal import Share
from gateway.records.records import Records
from gateway.records.undo import Undo, UndoChange
from gateway.wire.framing import ErrorKind, RpcError, refuse

log = logging.getLogger(__name__)

GATEWAY = "gateway"  # who the journal says it was, where nobody asked


class TrialJobs:
    """One robot's."""

    def __init__(self, rules: Rules, authority: Authority, records: Records, writer: Writer) -> None:
        self._rules = rules
        self._authority = authority
        self._undos = records.undo
        self._journal = records.journal
        self._let_pass = partial(writer.let_pass, Turn.TRIAL)

    def confirm(self, write: int) -> dict[str, float] | None:
        """Keep the values that the devices still hold; `None` if none is left.

        Raises:
            RpcError: it stays on trial.

        """
        undo = self._undos.get(write)
        if undo is None:
            return None
        for change in undo.changes:
            self._check_held(change)
        try:
            self._journal.append(undo.who, "trial confirmed", write=write).result()
            self._undos.change(drop=[write])
        except OSError as error:
            text = f"the confirmation could not be recorded, it stays on trial: {error.strerror or error}"
            self._journal.append(undo.who, "trial NOT confirmed", Share.ASKED, write=write, result=text)
            raise refuse(ErrorKind.UNAVAILABLE, text) from error
        return undo.values()

    def _check_held(self, change: UndoChange) -> None:
        try:
            parameter, node = self._rules.reach(change)
            held = result(node.upload(parameter.index, parameter.subindex))
        except (OutOfReach, DriverError, TimeoutError) as error:
            raise _stays(ErrorKind.UNAVAILABLE, change, f": {str(error) or 'no answer'}") from error
        if held.hex() != change.written:
            raise _stays(ErrorKind.MISMATCH, change, f" holds {held.hex(' ')} and not what was written")

    def take_back(self, write: int, why: str, known: str | None) -> TakenBack | None:
        """One attempt; `None` where nothing is to be taken back any more. `known` was said before."""
        undo = self._undos.get(write)
        if undo is None:
            return None
        attempt = Attempt(self._rules, self._authority, self._undos, write, self._let_pass)
        found = attempt.take_back(undo.changes)
        if found.problem is None or found.problem != known:
            what = "taken back" if found.problem is None else "NOT TAKEN BACK yet"
            log.warning("write %d of %s %s (%s): %s", write, undo.who, what, why, found.outcome)
            self._tell(what, write=write, reason=why, outcome=found.outcome)
        self._undos.leave(write, found.left)
        return found

    def concerned(self) -> bool:
        """Return whether there is anything to claim. From any thread."""
        changes = (change for undo in self._undos.all() for change in undo.changes)
        return any(change.address in self._authority.locked for change in changes)

    def claim(self) -> list[int]:
        """End trials of values that stop a controller: a stop has set them, so they are never reverted.

        Returns the writes concerned.
        """
        claimed = {}
        for undo in self._undos.all():
            theirs = [one for one in undo.changes if one.address in self._authority.locked]
            if theirs:
                claimed[undo.write] = {one.parameter: CLAIMED for one in theirs}
                self._let_go(undo, theirs)
        for write, said in claimed.items():
            self._tell("claimed by the stop", write=write, outcome=said)
        return list(claimed)

    def _let_go(self, undo: Undo, claimed: list[UndoChange]) -> None:
        rest = tuple(one for one in undo.changes if one not in claimed)
        if rest:
            self._undos.settle(put=[msgspec.structs.replace(undo, changes=rest)])
        else:
            self._undos.settle(drop=[undo.write])

    def _tell(self, what: str, **details: object) -> None:
        """Append to the journal; a failing disk was logged, and the work is done."""
        outcome(self._journal.append(GATEWAY, what, **details))


def _stays(kind: ErrorKind, change: UndoChange, text: str) -> RpcError:
    return refuse(kind, f"{change.parameter}{text}; it stays on trial", component=change.component)
