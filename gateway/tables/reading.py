"""A file's TOML as nested tables; where it is none, the line is shown with what was likely meant."""

import codecs
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from gateway.tables.finding import Finding

_ENCODINGS: Final = (
    (codecs.BOM_UTF8, "begins with a byte order mark (BOM): save it as UTF-8 without BOM"),
    (codecs.BOM_UTF16_LE, "is UTF-16: save it as UTF-8"),
    (codecs.BOM_UTF16_BE, "is UTF-16: save it as UTF-8"),
)
_PLACE: Final = r" \(at (?:line (?P<line>\d+), column \d+|end of document)\)$"
# What a line with a mistake looks like, and what it likely should be; the first one counts.
_HINTS: Final = (
    (r"\s*\[[^\]]*$", "a table's header ends with ]"),
    (r"\s*[\w.\"-]+\s*:\s", "write KEY = VALUE"),
    (r"[^=]*=\s*[+-]?\d+,\d", "decimals are written with a point"),
    (r"[^=]*=\s*(True|False|TRUE|FALSE)\b", "true and false are written small"),
    (r"[^=]*=\s*\"[^\"]*\\", "a \\ within quotes begins a special character: take single quotes"),
    (r"[^=]*=\s*(#.*)?$", "a key without its value"),
    (r"[^=]*=\s*[A-Za-z_/~.*]", "text stands in quotes"),
    (r"[^=]*=\s*\"[^\"]*$", "the quotes do not end in this line"),
    (r"[^=]*=\s*\S+\s+[^#\s]", "something follows the value: a new key begins a new line"),
)
_MOST: Final = 50  # mistakes that are told of what is no TOML
_DEEPEST: Final = 32  # tables and lists within one another: no file of ours has a quarter of that
_TOO_DEEP: Final = Finding(
    "", "", f"is nested too deeply: more than {_DEEPEST} tables or lists in one another"
)


class Unreadable(Exception):
    """The file is not there, is no text, no TOML, or nested too deeply."""

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.words)
        self.finding = finding


def read(file: Path) -> dict[str, Any]:
    """Return the file's tables.

    Raises:
        Unreadable: there are none; it says at which line, and what was likely meant. Reading ends there.

    """
    return parse(content(file))


def content(file: Path) -> bytes:
    """Return what stands in it; raises `Unreadable` where it cannot be read, or is no UTF-8."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise Unreadable(Finding("", "", f"cannot be read: {error.strerror}")) from error
    for mark, remedy in _ENCODINGS:
        if data.startswith(mark):
            raise Unreadable(Finding("", "", remedy))
    return data


def parse(data: bytes) -> dict[str, Any]:
    """Return the same for what stands in a file."""
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        said = "is no TOML: it is not in UTF-8; save it as UTF-8"
        raise Unreadable(Finding(f"line {line}", "", said)) from error
    try:
        tables = tomllib.loads(text)
    except RecursionError as error:
        raise Unreadable(_TOO_DEEP) from error
    except ValueError as error:
        raise Unreadable(_explained(str(error), text.splitlines())) from error
    if _is_too_deep(tables):
        raise Unreadable(_TOO_DEEP)
    return tables


def _is_too_deep(tables: dict[str, Any]) -> bool:
    """Return whether who goes through all of it could run out of stack."""
    level: list[Any] = [tables]
    for _ in range(_DEEPEST):
        level = [part for whole in level for part in _parts(whole)]
    return bool(level)


def _parts(whole: Any) -> Iterable[Any]:
    """Return the tables and lists that a table or list holds."""
    held = whole.values() if isinstance(whole, dict) else whole
    return (one for one in held if isinstance(one, dict | list))


def as_far_as_readable(file: Path, first: Finding) -> tuple[list[Finding], str | None]:
    """Return the lines that keep a file from being TOML, and the text without them.

    `first` is what reading it has found. Behind a header that cannot be read, or a value that does not end,
    nobody knows what is meant: no text then.
    """
    found = [first]
    try:
        lines = file.read_bytes().decode("utf-8").split("\n")
    except (OSError, UnicodeDecodeError):
        return found, None
    while len(found) < _MOST and (number := _line_of(found[-1])) is not None and _is_wrong(lines, number):
        lines[number - 1] = ""
        try:
            parse("\n".join(lines).encode())
        except Unreadable as error:
            found.append(error.finding)
        else:
            return found, "\n".join(lines)
    return found, None


def _line_of(finding: Finding) -> int | None:
    word, _, number = finding.where.partition(" ")
    return int(number) if word == "line" and number.isdecimal() else None


def _is_wrong(lines: list[str], number: int) -> bool:
    """Return whether it is this line alone that is wrong, and no header."""
    line = lines[number - 1] if number <= len(lines) else ""
    if not line.strip() or line.lstrip().startswith("["):
        return False
    try:
        tomllib.loads(line)
    except (ValueError, RecursionError):
        return True
    return False


def _explained(said: str, text: list[str]) -> Finding:
    place = re.search(_PLACE, said)
    what = said if place is None else said[: place.start()]
    number = int(place["line"]) if place is not None and place["line"] else len(text)
    line = text[number - 1].strip() if 0 < number <= len(text) else ""
    hint = "it stands there twice" if _is_again(what) else _hint(text[number - 1] if line else "")
    remedy = f"; {hint}" if hint else ""
    return Finding(f"line {number}", "", f"is no TOML: {line[:80]!r}: {what}{remedy}")


def _is_again(what: str) -> bool:
    return "twice" in what or "overwrite" in what


def _hint(line: str) -> str:
    return next((hint for pattern, hint in _HINTS if re.match(pattern, line)), "")
