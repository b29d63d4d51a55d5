"""Values changed in the server's file: only the lines that they stand in, all else stays as it was."""

import contextlib
import json
import math
import os
import re
import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from server_gui.core.cloud.atomic_files import draft
from server_gui.core.settings.server_file import SettingsError, load

Value = str | float | bool
Changes = Mapping[tuple[str, str], Value]  # table and key → what it is to be

_VALUE: Final = re.compile(r"""\s*("[^"\\]*(?:\\.[^"\\]*)*"|'[^']*'|[^\s#"']+)""")


def change(file: Path, changes: Changes) -> None:
    """Write these into the file, which is made where there is none; it is there whole, or as it was.

    Raises:
        SettingsError: with them the server could not begin, or the file cannot be written, or is written in a
            way in which a value cannot be changed alone; the message says what to do. Nothing was changed.

    """
    file = file.resolve()
    old = _read(file)
    new = changed(old, changes)
    try:
        if tomllib.loads(new) != _with(tomllib.loads(old), changes):
            raise ValueError
    except (ValueError, RecursionError):  # also what is no TOML any more
        keys = ", ".join(f"[{table}] {key}" for table, key in changes)
        raise SettingsError(f"{file} cannot be changed here as it is written: change {keys} in it") from None
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with draft(file) as written:
            _write(written, new, file)
            _check(written)
    except OSError as error:
        raise SettingsError(f"{file} cannot be written: {error.strerror or error}") from error


def changed(text: str, changes: Changes) -> str:
    """The text with these values; a key that is not there comes at the beginning of its table."""
    for (table, key), value in changes.items():
        lines = text.splitlines(keepends=True)
        begin = _header(lines, table)
        if begin is None:
            gap = "" if not text else "\n" if text.endswith("\n") else "\n\n"
            text = f"{text}{gap}[{table}]\n{key} = {_toml(value)}\n"
            continue
        place = _line(lines, begin, key)
        if place is None:
            lines[begin] = f"{lines[begin].rstrip()}\n{key} = {_toml(value)}\n"
        else:
            lines[place] = _replaced(lines[place], value)
        text = "".join(lines)
    return text


def _header(lines: list[str], table: str) -> int | None:
    pattern = re.compile(rf"\s*\[\s*{re.escape(table)}\s*\]\s*(#.*)?$")
    return next((place for place, line in enumerate(lines) if pattern.match(line)), None)


def _line(lines: list[str], begin: int, key: str) -> int | None:
    """Where the key of the table that begins there has its value."""
    pattern = re.compile(rf"\s*{re.escape(key)}\s*=")
    for place in range(begin + 1, len(lines)):
        if lines[place].lstrip().startswith("["):
            return None
        if pattern.match(lines[place]):
            return place
    return None


def _replaced(line: str, value: Value) -> str:
    """The line with another value; what stands behind it stays."""
    name, _, rest = line.partition("=")
    found = _VALUE.match(rest)
    behind = "\n" if found is None else rest[found.end() :]
    return f"{name}= {_toml(value)}{behind}"


def _toml(value: Value) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        raise SettingsError(f"{value} is no number that can be meant")
    return json.dumps(value, ensure_ascii=False)  # strings, numbers and truth are written alike


def _with(document: dict[str, Any], changes: Changes) -> dict[str, Any]:
    for (table, key), value in changes.items():
        document.setdefault(table, {})[key] = value
    return document


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        return ""
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"{file} cannot be read: {error}") from error


def _write(written: Path, text: str, like: Path) -> None:
    with written.open("w", encoding="utf-8") as out:
        out.write(text)
        out.flush()
        os.fsync(out.fileno())
    with contextlib.suppress(FileNotFoundError):
        shutil.copymode(like, written)


def _check(written: Path) -> None:
    """Whether the server could begin with it."""
    try:
        load(written)
    except SettingsError as error:
        raise SettingsError(str(error).removeprefix(f"{written}: ")) from None
