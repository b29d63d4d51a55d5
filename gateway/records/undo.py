"""Writes to be reverted: each from before its first download until it is done or undone.

A gateway that crashes leaves here what it had begun and what was on trial; the next one takes it back.
"""

import logging
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import msgspec

from gateway.records import durable
from gateway.records.chain import UNDECODABLE

log = logging.getLogger(__name__)


Bytes = Annotated[str, msgspec.Meta(pattern=r"^([0-9a-f]{2})*$")]  # hexadecimal


class UndoChange(msgspec.Struct, frozen=True):
    """One object that was, or was about to be, written: where it is, its bytes and values.

    `made` is what the device has made of `written`, where it was read back as something else.
    """

    parameter: str
    component: str
    bus: str
    node_id: int
    index: int
    subindex: int
    before: Bytes
    written: Bytes
    before_value: float
    written_value: float
    made: Bytes = ""

    @property
    def address(self) -> tuple[str, int, int, int]:
        """Bus, node id, index and sub-index."""
        return self.bus, self.node_id, self.index, self.subindex


class Undo(msgspec.Struct, frozen=True):
    """One write, its changes in the order of their downloads."""

    write: Annotated[int, msgspec.Meta(ge=0, lt=1 << 62)]  # later writes are numbered on from there
    who: str
    utc_ns: int
    trial: bool
    changes: tuple[UndoChange, ...]

    def values(self) -> dict[str, float]:
        return {change.parameter: change.written_value for change in self.changes}

    def before(self) -> dict[str, float]:
        return {change.parameter: change.before_value for change in self.changes}


class UndoFile:
    """All writes that may have to be taken back, on disk before they happen. For one thread at a time.

    As long as there is a `problem`, nothing can be kept, and so nothing may be written to a device.
    """

    def __init__(self, path: Path, unusable: str | None = None) -> None:
        self.problem = unusable
        self._path = path
        self._undos: dict[int, Undo] = {}

    def load(self) -> tuple[list[Undo], str | None]:
        """Return the undo entries of the last gateway, oldest first.

        And what is wrong with the file, then put aside.
        """
        if self.problem is not None:
            return [], None
        try:
            found = msgspec.json.decode(self._path.read_bytes(), type=list[Undo])
        except FileNotFoundError:
            return [], None
        except (OSError, *UNDECODABLE) as error:
            return [], self._put_aside(error)
        self._undos = {undo.write: undo for undo in found}
        return found, None

    def all(self) -> tuple[Undo, ...]:
        """Oldest first."""
        return tuple(self._undos.values())

    def get(self, write: int) -> Undo | None:
        return self._undos.get(write)

    def change(self, put: Iterable[Undo] = (), drop: Iterable[int] = ()) -> None:
        """Put some and drop others in one step; raises `OSError`, and is as before, where that failed."""
        changed = self._changed(put, drop)
        self._write(changed)
        self._undos = changed

    def settle(self, put: Iterable[Undo] = (), drop: Iterable[int] = ()) -> None:
        """Record a fact that has happened already; a failing disk is only logged.

        The disk has it with the next change; a gateway that finds it there takes back what is left of it.
        """
        self._undos = self._changed(put, drop)
        try:
            self._write(self._undos)
        except OSError as error:
            log.error("the undo file cannot be written: %s", error)

    def leave(self, write: int, left: Iterable[UndoChange]) -> None:
        """Keep only these of a write to be reverted; its trial has ended."""
        undo = self._undos.get(write)
        names = {change.parameter for change in left}
        rest = tuple(one for one in undo.changes if one.parameter in names) if undo is not None else ()
        if undo is not None and rest:
            self.settle(put=[msgspec.structs.replace(undo, trial=False, changes=rest)])
        elif undo is not None:
            self.settle(drop=[write])

    def _changed(self, put: Iterable[Undo], drop: Iterable[int]) -> dict[int, Undo]:
        dropped = set(drop)
        changed = {write: undo for write, undo in self._undos.items() if write not in dropped}
        return changed | {undo.write: undo for undo in put}

    def _write(self, undos: dict[int, Undo]) -> None:
        if self.problem is not None:
            raise OSError(None, self.problem)
        if undos:
            durable.write(self._path, msgspec.json.encode(list(undos.values())))
        else:
            durable.remove(self._path)

    def _put_aside(self, error: Exception) -> str:
        so = "writes that were on trial may still be in force; compare the robot's parameters with what they "
        so += "should be"
        kept = self._path.with_name(f"{self._path.name}.broken-{time.time_ns()}")
        try:
            self._path.replace(kept)
        except OSError as failure:
            self.problem = (
                f"{self._path} cannot be read ({error}) nor put aside ({failure.strerror or failure}): {so}, "
                "then move it away; nothing is written to a device until the gateway has started without it"
            )
            return self.problem
        return f"{self._path} cannot be read ({error}), it is now {kept.name}: {so}"
