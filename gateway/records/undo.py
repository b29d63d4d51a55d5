"""What is to be taken back: every write, from before its first download until it is done or undone.

A gateway that crashes leaves here what it had begun and what was on trial; the next one takes it back.
"""

import time
from collections.abc import Iterable
from pathlib import Path

import msgspec

from gateway.records import durable


class UndoChange(msgspec.Struct, frozen=True):
    """One object that was, or was about to be, written: where it is, its bytes (hexadecimal) and values."""

    parameter: str
    component: str
    bus: str
    node_id: int
    index: int
    subindex: int
    before: str
    written: str
    before_value: float
    written_value: float


class Undo(msgspec.Struct, frozen=True):
    """One write, its changes in the order of their downloads."""

    write: int
    who: str
    utc_ns: int
    trial: bool
    changes: tuple[UndoChange, ...]

    def values(self) -> dict[str, float]:
        return {change.parameter: change.written_value for change in self.changes}

    def before(self) -> dict[str, float]:
        return {change.parameter: change.before_value for change in self.changes}


class UndoFile:
    """All writes that may have to be taken back, on disk before they happen. For one thread at a time."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._undos: dict[int, Undo] = {}

    def load(self) -> tuple[list[Undo], str | None]:
        """What the last gateway left, oldest first; and what is wrong with the file, then put aside."""
        try:
            found = msgspec.json.decode(self._path.read_bytes(), type=list[Undo])
        except FileNotFoundError:
            found = []
        except (OSError, msgspec.DecodeError) as error:
            kept = self._path.with_name(f"{self._path.name}.broken-{time.time_ns()}")
            self._path.replace(kept)
            return [], (
                f"{self._path} cannot be read ({error}), it is now {kept.name}: writes that were on trial "
                "may still be in force; compare the robot's parameters with what they should be"
            )
        self._undos = {undo.write: undo for undo in found}
        return found, None

    def all(self) -> tuple[Undo, ...]:
        return tuple(self._undos.values())

    def get(self, write: int) -> Undo | None:
        return self._undos.get(write)

    def change(self, put: Iterable[Undo] = (), drop: Iterable[int] = ()) -> None:
        """Put some and drop others in one step; raises `OSError`, and is as before, where that failed."""
        dropped = set(drop)
        changed = {write: undo for write, undo in self._undos.items() if write not in dropped}
        changed |= {undo.write: undo for undo in put}
        if changed:
            durable.write(self._path, msgspec.json.encode(list(changed.values())))
        else:
            durable.remove(self._path)
        self._undos = changed
