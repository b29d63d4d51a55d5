"""Taking a write back: each object is read first, and only what is still ours is written over.

A value that is neither what we wrote nor what was there before belongs to somebody else (another master, a
technician's tool, a drive that was switched off and on): it is left alone, and that is said.
"""

from collections.abc import Callable
from dataclasses import dataclass

from drivers.errors import DriverError, Mismatch
from gateway.modules.transaction import ANSWER_S, Node
from gateway.records.undo import Undo, UndoChange

TAKEN_BACK, UNCHANGED = "taken back", "unchanged"


class OutOfReach(Exception):
    """The device cannot be asked; `final` where it never will be."""

    def __init__(self, why: str, *, final: bool) -> None:
        super().__init__(why)
        self.final = final


Reach = Callable[[UndoChange], Node]  # raises OutOfReach


@dataclass(frozen=True, slots=True)
class TakenBack:
    """In words, what became of each parameter; and why some could not be taken back yet."""

    outcome: dict[str, str]
    problem: str | None


def take_back(undo: Undo, reach: Reach) -> TakenBack:
    """Take back all that can be, the last write first. Raises nothing for what a device does."""
    outcome: dict[str, str] = {}
    problems = []
    for change in reversed(undo.changes):
        try:
            outcome[change.parameter] = _take_back_one(change, reach(change))
        except OutOfReach as error:
            outcome[change.parameter] = f"{'given up' if error.final else 'unknown'}: {error}"
            if not error.final:
                problems.append(f"{change.parameter}: {error}")
        except (DriverError, TimeoutError) as error:
            outcome[change.parameter] = f"unknown: {error}"
            problems.append(f"{change.parameter}: {error}")
    return TakenBack(outcome, "; ".join(problems) or None)


def _take_back_one(change: UndoChange, node: Node) -> str:
    before, written = bytes.fromhex(change.before), bytes.fromhex(change.written)
    held = _read(change, node)
    if held == before:
        return UNCHANGED
    if held != written:
        return (
            f"left alone: it holds {held.hex(' ')}, neither the {written.hex(' ')} that was written nor the "
            f"{before.hex(' ')} from before: somebody else changed it, or the device was restarted"
        )
    node.download(change.index, change.subindex, before).result(ANSWER_S)
    held = _read(change, node)
    if held != before:
        raise Mismatch(f"{before.hex(' ')} was written back, the device holds {held.hex(' ')}")
    return TAKEN_BACK


def _read(change: UndoChange, node: Node) -> bytes:
    return node.upload(change.index, change.subindex).result(ANSWER_S)
