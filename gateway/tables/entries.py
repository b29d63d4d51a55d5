"""One line of a TOML file, set or taken away; all else in it, comments too, stays as it was."""

import json
import re
import tomllib
from typing import Any, Final

_HEADER: Final = re.compile(r"\s*\[+\s*([^\]]*?)\s*\]+\s*(#.*)?")


class NoSuchLine(ValueError):
    """The file is not written in a way in which that line could be changed; says which to change by hand."""


def with_entry(text: str, table: str, key: str, value: str | dict[str, str]) -> str:
    """Return the text with `key = value` in `[table]`, which is added where there is none.

    Raises:
        NoSuchLine: it cannot be set without touching more than that.

    """
    wanted = _parsed(text)
    entries = wanted.setdefault(table, {})
    if not isinstance(entries, dict):
        raise NoSuchLine(f"{table} is no table: change {key} in it by hand")
    entries[key] = value
    line = f"{json.dumps(key, ensure_ascii=False)} = {_value(value)}"
    lines, span = _without(text, table, key)
    if span is None:
        lines += ([""] if lines and lines[-1] else []) + [f"[{table}]", line]
    else:
        lines.insert(span, line)
    return _checked(lines, wanted, f"[{table}] {key}")


def without_entry(text: str, table: str, key: str) -> str:
    """Return the text without it; the same where there is none.

    Raises:
        NoSuchLine: it cannot be taken away without touching more than that.

    """
    wanted = _parsed(text)
    if key not in wanted.get(table, {}):
        return text
    del wanted[table][key]
    return _checked(_without(text, table, key)[0], wanted, f"[{table}] {key}")


def _without(text: str, table: str, key: str) -> tuple[list[str], int | None]:
    """Return the lines without the entry, and where in them one of that table could stand.

    None: it is not there.
    """
    named = re.compile(rf"""\s*["']?{re.escape(key)}["']?\s*=""")
    kept: list[str] = []
    place: int | None = None
    within = False
    for line in text.splitlines():
        if header := _HEADER.fullmatch(line):
            within = header[1] == table
        elif within and named.match(line):
            continue
        kept.append(line)
        if within and line.strip():
            place = len(kept)
    return kept, place


def _checked(lines: list[str], wanted: dict[str, Any], what: str) -> str:
    text = "\n".join(lines) + "\n"
    try:
        is_meant = tomllib.loads(text) == wanted
    except ValueError:
        is_meant = False
    if not is_meant:
        raise NoSuchLine(f"{what} stands there in another way than as one line: change it by hand")
    return text


def _parsed(text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise NoSuchLine(f"it is not TOML ({error}): correct it first") from error


def _value(value: str | dict[str, str]) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return "{ " + ", ".join(f"{name} = {_value(one)}" for name, one in value.items()) + " }"
