"""Evidence beside the journal's entries at the desk: a file a robot, of JSON lines.

A line is `{"format": 1, "edit": {…}, "evidence": {…}, …}`; of an edit the newest line counts.
`docs/reference/store.md` says what is in them. Lines are only ever added; what a newer program has written in
another format is left alone. Whoever writes has the folder to itself: a recorder that adds a line, and a
command that forgets a wearer, may come at the same instant.
"""

import contextlib
import logging
import os
import re
from collections.abc import Collection
from pathlib import Path
from typing import Final

import msgspec
from msgspec import Struct

from ml.store.locks import turn
from ml.store.private import opener, private_folder
from server_gui.core.atomic_files import draft
from server_gui.core.evidence.comparison import Evidence
from server_gui.core.evidence.curves import Curves
from server_gui.core.evidence.edits import Edit
from server_gui.core.evidence.experiment import Experiment

log = logging.getLogger(__name__)

FORMAT: Final = 1


class EditEvidence(Struct, frozen=True):
    """An edit and its evidence; `is_final` where no more of it can come. `session` is the recording's."""

    edit: Edit
    evidence: Evidence
    is_final: bool
    session: str = ""
    curves: tuple[Curves, ...] = ()
    experiment: Experiment | None = None  # several trials that were one: `edit` stands for all of them
    format: int = FORMAT


class _Line(Struct):
    """Common part of all formats."""

    format: int


def folder_beside(spool: Path) -> Path:
    """Return where evidence is kept: beside the recorder's spool."""
    return spool.with_name("edits")


class _Robot(Struct):
    robot: str


class _Whose(Struct):
    edit: _Robot
    session: str


class EvidenceFile:
    """One robot's; nothing is there before the first edit."""

    def __init__(self, folder: Path, robot: str) -> None:
        self.path = folder / (re.sub(r"[^A-Za-z0-9_.-]", "_", robot).strip(".") + ".jsonl")

    def add(self, told: EditEvidence) -> None:
        """Add a line, durably; raises `OSError`."""
        private_folder(self.path.parent)
        with turn(self.path.parent), open(self.path, "ab", opener=opener) as file:
            torn = file.tell() and not _ends_whole(self.path)
            file.write(b"\n" * bool(torn) + msgspec.json.encode(told) + b"\n")
            file.flush()
            os.fsync(file.fileno())

    def read(self) -> dict[str, EditEvidence]:
        """Return the evidence of each edit, by its id, oldest first; raises `OSError`."""
        found: dict[str, EditEvidence] = {}
        with contextlib.suppress(FileNotFoundError), self.path.open("rb") as lines:
            for number, line in enumerate(lines, 1):
                told = self._told(line, number)
                if told is not None:
                    found.pop(told.edit.id, None)
                    found[told.edit.id] = told
        return dict(sorted(found.items(), key=lambda item: item[1].edit.utc_ns))

    def _told(self, line: bytes, number: int) -> EditEvidence | None:
        if not line.strip():
            return None
        try:
            if msgspec.json.decode(line, type=_Line).format != FORMAT:
                log.warning("%s, line %d: another format; a newer gwrms can read it", self.path, number)
                return None
            return msgspec.json.decode(line, type=EditEvidence)
        except (msgspec.DecodeError, RecursionError) as error:
            log.warning("%s, line %d is damaged and left out: %s", self.path, number, error)
            return None


def _ends_whole(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"


def forget(folder: Path, sessions: Collection[tuple[str, str]]) -> list[str]:
    """Remove what was kept of these recordings (robot, session); what could not be, in words.

    A line that is damaged goes, too: whose it was cannot be told any more.
    """
    left = []
    for path in sorted(folder.glob("*.jsonl")) if folder.is_dir() else []:
        try:
            with turn(folder):
                _without(path, sessions)
        except OSError as error:
            left.append(f"{path} may have edits of theirs: {error}")
    return left


def _without(path: Path, sessions: Collection[tuple[str, str]]) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    kept = [line for line in lines if (whose := _whose(line)) is not None and whose not in sessions]
    if len(kept) < len(lines):
        with draft(path) as written:
            written.write_bytes(b"".join(kept))


def _whose(line: bytes) -> tuple[str, str] | None:
    """Return the robot and the recording of a line of any format; None where nobody can tell."""
    try:
        found = msgspec.json.decode(line, type=_Whose)
    except (msgspec.DecodeError, RecursionError):
        return None
    return found.edit.robot, found.session


def read_all(folder: Path) -> list[EditEvidence]:
    """Return every edit that is kept there, oldest first; raises `OSError`."""
    paths = sorted(folder.glob("*.jsonl")) if folder.is_dir() else []
    found = [told for path in paths for told in EvidenceFile(folder, path.stem).read().values()]
    return sorted(found, key=lambda told: told.edit.utc_ns)
