"""Values changed in the server's file: only the lines that they stand in, all else stays as it was."""

import contextlib
import math
import os
import shutil
from collections.abc import Mapping, MutableMapping
from pathlib import Path

import tomlkit
from tomlkit.exceptions import TOMLKitError

from server_gui.core.atomic_files import draft
from server_gui.core.settings.server_file import SettingsError, load

Value = str | float | bool
Changes = Mapping[tuple[str, str], Value]  # table and key → what it is to be


def change(file: Path, changes: Changes) -> None:
    """Write these into the file, which is made where there is none; it is there whole, or as it was.

    Raises:
        SettingsError: with them the server could not begin, or the file cannot be written, or is no TOML; the
            message says what to do. Nothing was changed.

    """
    file = file.resolve()
    try:
        new = changed(_read(file), changes)
    except (TOMLKitError, ValueError, TypeError, RecursionError) as error:
        keys = ", ".join(f"[{table}] {key}" for table, key in changes)
        raise SettingsError(
            f"{file} cannot be changed as it is written ({error}): change {keys} in it"
        ) from error
    try:
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with draft(file) as written:
            _write(written, new, file)
            _check(written)
    except OSError as error:
        raise SettingsError(f"{file} cannot be written: {error.strerror or error}") from error


def changed(text: str, changes: Changes) -> str:
    """Return the TOML document with these values; all else, comments and layout too, stays as it was.

    Raises:
        SettingsError: a value is no number that can be meant.
        TOMLKitError: the text is no TOML.
        TypeError: there is something else where a table should be.

    """
    document = tomlkit.parse(text)
    for (table, key), value in changes.items():
        if isinstance(value, float) and not math.isfinite(value):
            raise SettingsError(f"{value} is no number that can be meant")
        entries = document.setdefault(table, tomlkit.table())
        if not isinstance(entries, MutableMapping):
            raise TypeError(f"{table} is no table")
        entries[key] = value
    return tomlkit.dumps(document)


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
    """Check that the server could begin with it."""
    try:
        load(written)
    except SettingsError as error:
        raise SettingsError(str(error).replace(f"{written}: ", "")) from None
