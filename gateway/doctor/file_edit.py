"""Lines of the robot's file changed where they stand: all else stays as it was, or nothing is changed."""

import copy
import fcntl
import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import reduce
from pathlib import Path
from typing import Any

from gateway.config.reading import examined
from gateway.config.robot import header
from gateway.doctor.verdicts import Edit, Plain
from gateway.records import durable
from gateway.tables.finding import lines, mistakes


class NotMended(Exception):
    """A fix that failed, and the reason."""


def change(path: Path, edits: Sequence[Edit]) -> None:
    """Make the edits, all or none; a link stays one, and the file stays its owner's.

    Raises:
        NotMended: somebody has changed the file since it was read, or is at it, or it would be a wrong one.

    """
    path = path.resolve()
    try:
        with _alone(path):
            before = path.read_bytes().decode("utf-8")
            durable.write(path, _changed(path, before, edits).encode("utf-8"), like=path.stat())
    except (OSError, UnicodeDecodeError) as error:
        raise NotMended(f"{path} cannot be changed: {error}") from error


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as error:
        raise NotMended(f"another program changes {path} now: ask again when it has ended") from error
    finally:
        os.close(folder)


def _changed(path: Path, before: str, edits: Sequence[Edit]) -> str:
    returns = before.count("\r\n")
    if returns and returns != before.count("\n"):
        raise NotMended(f"{path} has lines of Windows and of Unix: {_by_hand(edits)}")
    after = reduce(edited, edits, before.replace("\r\n", "\n"))
    found = examined(path, tomllib.loads(after))
    if found.config is None:
        raise NotMended(f"the file would not be taken any more:\n{lines(path, mistakes(found.findings))}")
    return after.replace("\n", "\r\n") if returns else after


def _by_hand(edits: Sequence[Edit]) -> str:
    return f"{' and '.join(edit.words for edit in edits)}, by hand"


def edited(text: str, fix: Edit) -> str:
    """Return the file with that line.

    Raises:
        NotMended: it cannot be found, or is not what was judged, or the file would say anything else too.

    """
    try:
        wanted = copy.deepcopy(tomllib.loads(text))
        table = wanted[fix.kind][fix.name]
        _check_same(fix, table)
        table[fix.key] = fix.value
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
        raise NotMended(f"the file is written in a way that is not safe to change: {_by_hand([fix])}")
    return changed


def _check_same(fix: Edit, table: Mapping[str, Plain]) -> None:
    """Check that the key still has the judged value: a missing key has its default."""
    if fix.key in table and table[fix.key] != fix.was:
        raise NotMended(
            f"{header(fix.kind, fix.name)} {fix.key} is {json.dumps(table[fix.key])} by now, and was judged "
            f"as {json.dumps(fix.was)}: ask the doctor again"
        )


def _with_line(text: str, fix: Edit) -> str:
    """Return the key's line with the new value and its comment, else a new one after the header."""
    name = rf'(?:{re.escape(fix.name)}|"{re.escape(fix.name)}")'
    head = re.search(rf"^[ \t]*\[{fix.kind}\.{name}\][^\n]*\n?", text, re.MULTILINE)
    if head is None:
        return text
    following = re.search(r"^[ \t]*\[", text[head.end() :], re.MULTILINE)
    end = len(text) if following is None else head.end() + following.start()
    new = f"{fix.key} = {_toml(fix.value)}"
    line = re.compile(rf"^([ \t]*){re.escape(fix.key)}[ \t]*=[^\n#]*?([ \t]*#[^\n]*)?$", re.MULTILINE)
    body, count = line.subn(lambda found: f"{found[1]}{new}{found[2] or ''}", text[head.end() : end], count=1)
    if not count:
        start = text[: head.end()]
        return f"{start}{'' if start.endswith(chr(10)) else chr(10)}{new}\n{body}{text[end:]}"
    return text[: head.end()] + body + text[end:]


def _toml(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
