"""Taking back what was written: each object is read first, and only what is still ours is written over.

Roll-back, the end of a trial, a revert and what a crash has left all come here. A value that is neither what
we wrote, or what the device made of that, nor what was there before belongs to somebody else (another master,
a technician's tool, a drive that was switched off and on): it is left alone, and that is said. What may not
be written now stays to be taken back, and so does what nobody knows.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from drivers.bus.values import size_of
from drivers.errors import DeviceTimeout, DriverError, Mismatch, NotPermitted
from gateway.modules.control.objects import Node, ask_patiently, download, result, results
from gateway.modules.control.parameters import Parameter
from gateway.modules.control.rules import OutOfReach, Rules
from gateway.modules.stop.authority import LOCKED, Address, Authority
from gateway.records.undo import UndoChange, UndoFile
from gateway.wire.framing import RpcError

TAKEN_BACK, UNCHANGED, CLAIMED = "taken back", "unchanged", "left as the stop set it"
AS_IT_SHOULD_BE = frozenset({TAKEN_BACK, UNCHANGED, CLAIMED})


@dataclass(frozen=True, slots=True)
class TakenBack:
    """In words, what became of each parameter; and what is still to be taken back, in its order, and why."""

    outcome: dict[str, str]
    left: tuple[UndoChange, ...] = ()

    @property
    def problem(self) -> str | None:
        return "; ".join(f"{one.parameter}: {self.outcome[one.parameter]}" for one in self.left) or None


class _NotYet(Exception):
    """It stays to be taken back."""


class Attempt:
    """One attempt at one write, which is in the undo file. In the writer's thread.

    `let_pass` is called between two changes: what is more urgent may take its turn there.
    """

    def __init__(
        self, rules: Rules, authority: Authority, undos: UndoFile, write: int, let_pass: Callable[[], None]
    ) -> None:
        self._rules = rules
        self._authority = authority
        self._undos = undos
        self._write = write
        self._let_pass = let_pass
        self._silent: dict[tuple[str, int], str] = {}  # nodes that did not answer are not waited for again
        self._refused: dict[tuple[object, ...], str] = {}  # rules whose states the drives are not in

    def take_back(self, changes: Sequence[UndoChange]) -> TakenBack:
        """Take back all that can be, the last one first. Raises nothing for what a device does."""
        self._find_silent(changes)
        outcome, left = {}, []
        for change in reversed(changes):
            self._let_pass()
            try:
                outcome[change.parameter] = self._one(change)
            except _NotYet as error:
                outcome[change.parameter] = str(error)
                left.append(change)
        return TakenBack(outcome, tuple(reversed(left)))

    def _objection(self, address: Address) -> str | None:
        """Return the objection of a held stop, or one that has claimed the object. From any thread."""
        if address not in self._authority.locked:
            return None
        undo = self._undos.get(self._write)
        claimed = undo is None or all(change.address != address for change in undo.changes)
        return LOCKED if claimed else self._authority.objection_to(address)

    def _is_written_again(self, address: Address) -> bool:
        """Return whether a later write that is to be taken back, too, and first, writes it again."""
        writes = [undo.write for undo in self._undos.all()]
        later = self._undos.all()[writes.index(self._write) + 1 :]
        return any(change.address == address for undo in later for change in undo.changes)

    def _one(self, change: UndoChange) -> str:
        if self._objection(change.address) is not None:
            return CLAIMED
        try:
            parameter, node = self._rules.reach(change)
            return self._take_back(change, parameter, node)
        except OutOfReach as error:
            if error.final:
                return f"given up: {error}"
            raise _NotYet(f"unknown: {error}") from error
        except NotPermitted as error:
            if self._objection(change.address) is not None:
                return CLAIMED
            raise _NotYet(f"not yet: {error}") from error
        except (DriverError, TimeoutError) as error:
            raise _NotYet(f"unknown: {_words(error)}") from error

    def _take_back(self, change: UndoChange, parameter: Parameter, node: Node) -> str:
        if self._is_written_again(change.address):
            raise _NotYet("not yet: a later write of it is to be taken back first")
        before = bytes.fromhex(change.before)
        held = self._read(change, parameter, node)
        if held == before:
            return UNCHANGED
        if held.hex() not in (change.written, change.made or change.written):
            return _left_alone(change, held)
        try:
            self._rules.check_value(parameter, held, before)
        except RpcError as error:
            return f"given up: {error}"
        self._check_states(parameter)
        with suppress(TimeoutError):  # what the device holds now is what counts
            download(node, change.address, before, self._objection)
        held = self._read(change, parameter, node)
        if held != before:
            raise Mismatch(f"{before.hex(' ')} was written back, the device holds {held.hex(' ')}")
        return TAKEN_BACK

    def _check_states(self, parameter: Parameter) -> None:
        """Asked anew for each change; where the answer was no, it is for all of the same rule."""
        same = (parameter.component, parameter.settings.live, parameter.settings.states)
        try:
            if same not in self._refused:
                self._rules.check_states(parameter)
        except RpcError as error:
            self._refused[same] = f"not yet: {error}"
        if same in self._refused:
            raise _NotYet(self._refused[same])

    def _read(self, change: UndoChange, parameter: Parameter, node: Node) -> bytes:
        place = change.bus, change.node_id
        if place in self._silent:
            raise DeviceTimeout(self._silent[place])
        try:
            data = result(ask_patiently(node, change.address))
        except TimeoutError as error:
            self._silent[place] = _words(error)
            raise
        return data[: size_of(parameter.data_type)]  # some devices answer with more

    def _find_silent(self, changes: Sequence[UndoChange]) -> None:
        """Several that are dead take no longer than one: each node is asked, all of them at once."""
        first = {(change.bus, change.node_id): change for change in changes}
        asked = {}
        for place, change in first.items() if len(first) > 1 else ():
            with suppress(OutOfReach):
                asked[place] = ask_patiently(self._rules.reach(change)[1], change.address)
        told = results(asked)
        self._silent = {place: _words(one) for place, one in told.items() if isinstance(one, TimeoutError)}


def _left_alone(change: UndoChange, held: bytes) -> str:
    before, written = bytes.fromhex(change.before), bytes.fromhex(change.written)
    return (
        f"left alone: it holds {held.hex(' ')}, neither the {written.hex(' ')} that was written nor the "
        f"{before.hex(' ')} from before: somebody else changed it, or the device was restarted"
    )


def _words(error: Exception) -> str:
    return str(error) or "no answer"
