"""One value of a robot's file is another, with its comment; all else stays as it was written."""

import re
import tomllib
from typing import Any

from gateway.commission.draft import DraftValue
from gateway.commission.writing import line

OURS = "# rad; "  # a comment of `writing` that stands above its value


class NotEdited(ValueError):
    """The file is written in another way than such values are; the message says what to write by hand."""


def with_value(text: str, table: str, key: str, found: DraftValue) -> str:
    """Return the text with this value, line ends kept; the rest is the same by TOML's reading.

    Raises:
        NotEdited: the table, or the value, is not on lines of its own.

    """
    lines = text.split("\n")
    heads = [number for number, one in enumerate(lines) if _head(one) == table]
    end = "\r" if lines[0].endswith("\r") else ""
    new = [one + end for one in line(key, found).split("\n")]
    if len(heads) == 1:
        first = heads[0] + 1
        last = next((at for at in range(first, len(lines)) if _head(lines[at]) is not None), len(lines))
        found_at = [at for at in range(first, last) if re.match(rf"\s*{key}\s*=", lines[at])]
        at = found_at[0] if found_at else first
        begin = at - 1 if found_at and lines[at - 1].startswith(OURS) else at
        lines[begin : at + bool(found_at)] = new
    made = "\n".join(lines)
    if not _differ_only_in(text, made, table, key, found.value):
        raise NotEdited(f"[{table}] is not on lines of its own: write {line(key, found)} there yourself")
    return made


def comment_of(text: str, table: str, key: str) -> str:
    """Return the comment beside the value, or above it as `writing` puts it; "" without one."""
    current, above = None, ""
    for one in text.splitlines():
        current = _head(one) or current
        if current == table and re.match(rf"\s*{key}\s*=", one):
            return one.partition("#")[2].strip() or above
        above = one[1:].strip() if one.startswith(OURS) else ""
    return ""


def _head(text: str) -> str | None:
    found = re.match(r"\s*\[+\s*([^\]]+?)\s*\]", text)
    return None if found is None else found[1]


def _differ_only_in(before: str, after: str, table: str, key: str, value: Any) -> bool:
    try:
        old, new = tomllib.loads(before), tomllib.loads(after)
        expected: Any = old
        for part in table.split("."):
            expected = expected[part]
        expected[key] = value
    except (tomllib.TOMLDecodeError, KeyError):
        return False
    return old == new
