"""Mending, one thing at a time: a line of the robot's file, or an object through the gateway's own writes.

A line is changed where it stands, and taken only where the file then says exactly that and all else as
before. What was done is written down beside the robot's journal.
"""

import copy
import getpass
import json
import os
import re
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

from gateway.client import ClientError, Robot
from gateway.config.robot import RobotConfig, header
from gateway.doctor.verdicts import Edit, Finding, Fix, Together, Write

RECORD = "doctor.jsonl"


class NotMended(Exception):
    """What could not be done; the message says why, and nothing was changed."""


class Mender:
    """Does what is safe to do by itself: `robot` is `None` where no gateway runs."""

    def __init__(self, config: RobotConfig, robot: Robot | None) -> None:
        self._config = config
        self._robot = robot
        self._acts: Mapping[type[Fix], Callable[[Any], str]] = {
            Edit: lambda edit: self._edit((edit,)),
            Together: lambda fix: self._edit(fix.edits),
            Write: self._write,
        }

    def can(self, fix: Fix) -> bool:
        """Whether that is a fix of ours; all else is for people."""
        return fix.is_safe if isinstance(fix, Write) else type(fix) in self._acts

    def mend(self, finding: Finding, fix: Fix) -> str:
        """Do it; returns what was done.

        Raises:
            NotMended: it was not.

        """
        done = self._acts[type(fix)](fix)
        self._note(finding, fix, done)
        return done

    def _edit(self, edits: Sequence[Edit]) -> str:
        path = self._config.path
        try:
            before = path.read_text(encoding="utf-8")
            after = reduce(edited, edits, before)
            draft = path.with_name(f"{path.name}.new")
            draft.write_text(after, encoding="utf-8")
            draft.chmod(path.stat().st_mode)
            draft.replace(path)
        except (OSError, UnicodeDecodeError) as error:
            raise NotMended(f"{path} cannot be changed: {error}") from error
        return f"{path} changed: a gateway takes it at its next start"

    def _write(self, fix: Write) -> str:
        if self._robot is None:
            raise NotMended(f"objects are written through a gateway only: start it, then {fix.words}")
        try:
            written = self._robot.write({fix.address: fix.value})
        except ClientError as error:
            raise NotMended(f"the gateway refused: {error}. {_permission(fix)}") from error
        return f"written and read back (write {written.write}); gwrms store {fix.component} keeps it"

    def _note(self, finding: Finding, fix: Fix, done: str) -> None:
        folder = self._config.records
        row = {
            "utc_s": round(time.time(), 3),
            "who": getpass.getuser(),
            "rule": finding.rule,
            "about": finding.about,
            "evidence": list(finding.evidence),
            "fix": fix.words,
            "done": done,
        }
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with (folder / RECORD).open("a", encoding="utf-8") as file:
                file.write(json.dumps(row, ensure_ascii=False) + "\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise NotMended(f"it was done, but could not be written down in {folder}: {error}") from error


def _permission(fix: Write) -> str:
    """How the robot's owner lets it be written."""
    lines = (
        f'[parameter."{fix.component}.object_{fix.index:04x}"] object = "0x{fix.index:04X}:{fix.subindex}"'
    )
    return f"The robot's file has the last word on what may be written; this allows it: {lines}"


def edited(text: str, fix: Edit) -> str:
    """The file with that line.

    Raises:
        NotMended: it cannot be found, or the file would say anything else too.

    """
    try:
        wanted = copy.deepcopy(tomllib.loads(text))
        wanted[fix.kind][fix.name][fix.key] = fix.value
    except (tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise NotMended(
            f"the file has no {header(fix.kind, fix.name)} any more: change it by hand"
        ) from error
    changed = _with_line(text, fix)
    try:
        same = tomllib.loads(changed) == wanted
    except tomllib.TOMLDecodeError:
        same = False
    if not same:
        raise NotMended(f"the file is written in a way that is not safe to change: {fix.words}, by hand")
    return changed


def _with_line(text: str, fix: Edit) -> str:
    """The key's line in its table with the new value and its comment, else a new one behind the header."""
    name = rf'(?:{re.escape(fix.name)}|"{re.escape(fix.name)}")'
    head = re.search(rf"^[ \t]*\[{fix.kind}\.{name}\][^\n]*\n?", text, re.MULTILINE)
    if head is None:
        return text
    following = re.search(r"^[ \t]*\[", text[head.end() :], re.MULTILINE)
    end = len(text) if following is None else head.end() + following.start()
    new = f"{fix.key} = {json.dumps(fix.value, ensure_ascii=False)}"
    line = re.compile(rf"^([ \t]*){re.escape(fix.key)}[ \t]*=[^\n#]*?([ \t]*#[^\n]*)?$", re.MULTILINE)
    body, count = line.subn(lambda found: f"{found[1]}{new}{found[2] or ''}", text[head.end() : end], count=1)
    if not count:
        start = text[: head.end()]
        return f"{start}{'' if start.endswith(chr(10)) else chr(10)}{new}\n{body}{text[end:]}"
    return text[: head.end()] + body + text[end:]
